//! The law of a body: steps, states and stresses.

use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6};
use yawara_embed::{Strain, strain_from_gradient};
use yawara_mesh::TetId;

use super::storage::Body;
use crate::element::Element;
use crate::element::pressures::PressureTangent;
use crate::element::rotation::polar_warm;
use crate::field::Field;
use crate::law::states::{Question, States};
use crate::law::{ConstitutiveLaw, LawHalf};

/// What an element hands on when its tetrahedron splits or merges; empty under a linear law.
#[derive(Clone, Debug, PartialEq)]
pub struct LawState {
    /// The law's state at the end of the last step.
    pub state: Vec<f64>,
    /// σ − D ε̃ at the last evaluation, Pa.
    pub beyond: Strain,
}

impl Body {
    /// The same body, still without elements, under a law; [`LinearElastic`](crate::LinearElastic)
    /// without this.
    #[must_use]
    pub fn with_law(self, law: impl Into<Arc<dyn ConstitutiveLaw>>) -> Self {
        Self { states: States::new(law.into()), ..self }
    }

    /// How stress follows from strain.
    pub fn law(&self) -> &dyn ConstitutiveLaw {
        self.states.law()
    }

    /// Begins a step of `step_s`: from now on the law sees strains at its end and the states
    /// [committed](Self::commit) before. Without it no time passes.
    pub fn begin_step(&mut self, step_s: f64) {
        self.states.begin_step(step_s, &self.elements);
    }

    /// Ends the step: the states of the last evaluation of forces become those that the next step
    /// starts from.
    pub fn commit(&mut self) {
        self.states.commit(&self.elements);
    }

    /// The factor of the elasticity in the matrix whose inverse is kept, of the law and the step.
    pub fn stiffening(&self) -> f64 {
        self.states.stiffening()
    }

    /// What the material of an element has turned into heat so far, J/m³, if its law keeps count.
    ///
    /// # Panics
    /// If `number` is not below the number of [`elements`](Self::elements).
    pub fn dissipated(&self, number: usize) -> Option<f64> {
        self.law().dissipated(self.states.of(number))
    }

    /// What all elements have turned into heat so far, J, if their law keeps count.
    pub fn dissipated_j(&self) -> Option<f64> {
        let elements = self.elements().iter().enumerate();
        elements
            .map(|(number, element)| Some(element.geometry.volume * self.dissipated(number)?))
            .sum()
    }

    /// The equivalent plastic strain of an element, if strain can stay under its law.
    ///
    /// # Panics
    /// As [`dissipated`](Self::dissipated).
    pub fn plastic_strain(&self, number: usize) -> Option<f64> {
        self.law().plastic_strain(self.states.of(number))
    }

    /// What the element of a leaf tetrahedron hands on.
    pub fn law_state(&self, tet: TetId) -> Option<LawState> {
        let number = self.number(tet)?;
        Some(LawState {
            state: self.states.of(number).to_vec(),
            beyond: self.states.beyond(number),
        })
    }

    /// Gives an element what it, or the same one of another body, handed on. Nothing under a law without states.
    ///
    /// # Panics
    /// If `handed` is of a law with states of another length.
    pub fn set_law_state(&mut self, tet: TetId, handed: &LawState) {
        let Some(number) = self.number(tet).filter(|_| self.states.len() > 0) else { return };
        self.states.set((number, &self.elements[number]), &handed.state, handed.beyond);
    }

    /// Gives a half of a tetrahedron that has split what its parent handed on.
    pub fn split_law_state(&mut self, half: TetId, parent: &LawState) {
        let Some(number) = self.number(half).filter(|_| self.states.len() > 0) else { return };
        let mut state = vec![0.0; self.states.len()];
        self.law().split(&parent.state, &mut state);
        self.states.set((number, &self.elements[number]), &state, parent.beyond);
    }

    /// Gives a tetrahedron whose halves have merged what they handed on.
    pub fn merge_law_states(&mut self, parent: TetId, halves: [(&Element, &LawState); 2]) {
        let Some(number) = self.number(parent).filter(|_| self.states.len() > 0) else { return };
        let mut state = vec![0.0; self.states.len()];
        let both = halves.map(|(element, handed)| LawHalf {
            elasticity: &element.elasticity,
            volume: element.geometry.volume,
            state: &handed.state,
        });
        self.law().merge(&both, &mut state);
        let weighted = both.iter().zip(halves).map(|(half, (_, from))| from.beyond * half.volume);
        let volume = both[0].volume + both[1].volume;
        let beyond = weighted.sum::<Strain>() / volume;
        self.states.set((number, &self.elements[number]), &state, beyond);
    }

    /// The stress of an element in its co-rotated frame at `positions` (m, by vertex number), with
    /// its rotation, its pressures and what the law had beyond D ε̃ at the last evaluation of
    /// forces; Pa, Voigt order xx yy zz xy yz zx.
    ///
    /// # Panics
    /// If `number` is not below the number of [`elements`](Self::elements).
    pub fn stress(&self, number: usize, positions: &Field) -> Strain {
        let element = &self.elements()[number];
        self.stress_under(number, element, &self.corotated_strain(number, positions))
    }

    /// The [stress](Self::stress) of an element, and what it stores, J: its part of [`energy`](Self::energy).
    ///
    /// # Panics
    /// As [`stress`](Self::stress).
    pub fn stress_and_energy(&self, number: usize, positions: &Field) -> (Strain, f64) {
        let strain = self.corotated_strain(number, positions);
        let stress = self.stress_under(number, &self.elements()[number], &strain);
        (stress, self.stored_under(number, strain, || stress))
    }

    /// What elastic grips store at `positions` (m, by vertex number), J.
    pub fn energy_of_grips(&self, positions: &Field) -> f64 {
        self.grips().iter().map(|grip| grip.energy(positions)).sum()
    }

    /// Strain of an element with its rotation.
    fn corotated_strain(&self, number: usize, positions: &Field) -> Strain {
        self.elements()[number].corotated_strain(&self.rotation(number), positions)
    }

    /// The same of an element under `strain`.
    fn stress_under(&self, number: usize, element: &Element, strain: &Strain) -> Strain {
        let elastic = match &self.pressures {
            None => element.elasticity * strain,
            Some(pressures) => pressures.stress(number, element.vertices, strain),
        };
        if self.law().is_linear() { elastic } else { elastic + self.states.beyond(number) }
    }

    /// What the elements store at `positions` (m, by vertex number) with their rotations, ½ V σ : ε where their law says
    /// nothing else, and elastic grips, J. Cost: O(elements).
    pub fn energy(&self, positions: &Field) -> f64 {
        let elements = 0..self.elements().len();
        let stored = elements.map(|number| self.stored(number, &self.rotation(number), positions));
        stored.sum::<f64>() + self.energy_of_grips(positions)
    }

    /// What the element of a leaf tetrahedron stores at `positions` (m, by vertex number), and elastic
    /// grips in it, J: its share of [`energy`](Self::energy) with the rotation that it gets there, or the one
    /// that it has unless it [`turns`](crate::InternalForces::turns). 0 if there is no such element.
    /// Cost: O(1), and O(log elements) for each grip.
    pub fn energy_of(&self, tet: TetId, positions: &Field, turns: bool) -> f64 {
        let Some(number) = self.number(tet) else { return 0.0 };
        let mut rotation = self.rotation(number);
        if turns {
            let gradient = self.elements()[number].deformation_gradient(positions);
            rotation = polar_warm(&gradient, &rotation);
        }
        let held = self.grips().iter().map(|grip| grip.energy_of(tet, positions));
        self.stored(number, &rotation, positions) + held.sum::<f64>()
    }

    /// What an element stores with a rotation, J.
    fn stored(&self, number: usize, rotation: &Matrix3<f64>, positions: &Field) -> f64 {
        let element = &self.elements()[number];
        let strain = element.corotated_strain(rotation, positions);
        self.stored_under(number, strain, || self.stress_under(number, element, &strain))
    }

    /// What an element stores under a strain, J; `stress` is what it has then, Pa.
    fn stored_under(&self, number: usize, strain: Strain, stress: impl Fn() -> Strain) -> f64 {
        let element = &self.elements()[number];
        let pressures = self.pressures.as_ref();
        let density = self.states.energy(&Question { number, element, strain, pressures });
        let half = || 0.5 * stress().dot(&strain);
        element.geometry.volume * density.unwrap_or_else(half)
    }

    /// By how much D ε and the pressures' part of the [stress](Self::stress) of an element change where the
    /// body moves by `moves` (m) and its pressures by `q` (1), both by vertex number, with its rotation; Pa.
    ///
    /// # Panics
    /// As [`stress`](Self::stress), or if `moves` is shorter than a vertex number.
    pub fn stress_change(&self, number: usize, moves: &Field, q: &[f64]) -> Strain {
        let element = &self.elements()[number];
        let gradient = element.deformation_gradient(moves);
        let strain = strain_from_gradient(&(self.rotation(number).transpose() * gradient));
        match &self.pressures {
            None => element.elasticity * strain,
            Some(pressures) => {
                let q = element.vertices.map(|v| q.get(v).copied().unwrap_or(0.0));
                pressures.stress_of(number, 0.25 * q.iter().sum::<f64>(), &strain)
            }
        }
    }

    /// The stress of an element but for the part of its hydrostatic stress that belongs to
    /// pressures: D ε and what the law has beyond D ε̃. As [`stress`](Self::stress) with
    /// displacements alone; its von Mises stress is the same always.
    ///
    /// # Panics
    /// As [`stress`](Self::stress).
    pub fn stress_without_pressure(&self, number: usize, positions: &Field) -> Strain {
        let element = &self.elements()[number];
        let elastic = element.elasticity * self.corotated_strain(number, positions);
        if self.law().is_linear() { elastic } else { elastic + self.states.beyond(number) }
    }

    /// The law's answer for an element at `positions` with its stored rotation: σ and ∂σ/∂ε, Pa,
    /// pressures as they are.
    pub(crate) fn response(&self, number: usize, positions: &Field) -> (Strain, Matrix6<f64>) {
        let (stress, law, growth) = self.law_response(number, positions);
        match &self.pressures {
            None => (stress, law),
            Some(pressures) => (stress, pressures.tangent(number, &law, growth).modulus),
        }
    }

    /// How an element with pressures answers to small changes, at `positions`; none without.
    pub(crate) fn pressure_tangent(
        &self,
        number: usize,
        positions: &Field,
    ) -> Option<PressureTangent> {
        let pressures = self.pressures.as_ref()?;
        let (_, law, growth) = self.law_response(number, positions);
        Some(pressures.tangent(number, &law, growth))
    }

    /// σ and ∂σ/∂ε̃ at what the law sees, Pa, and the derivative of the law's own growth by ε if it has one.
    fn law_response(
        &self,
        number: usize,
        positions: &Field,
    ) -> (Strain, Matrix6<f64>, Option<Strain>) {
        let element = &self.elements()[number];
        if self.law().is_linear() {
            return (self.stress(number, positions), element.elasticity, None);
        }
        let strain = self.corotated_strain(number, positions);
        let pressures = self.pressures.as_ref();
        self.states.response(&Question { number, element, strain, pressures })
    }
}
