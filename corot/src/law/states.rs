//! The states of all elements of a body under its law.

use std::fmt;
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6};
use yawara_embed::Strain;

use super::constitutive_law::{ConstitutiveLaw, MaterialPoint, StepStart};
use super::linear::LinearElastic;
use super::packet_law::PacketLaw;
use crate::element::Element;
use crate::element::pressures::Pressures;
use crate::element::tetrahedron::stress_matrix;
use crate::element::turning::Turning;
use crate::field::Field;

/// A law and its states, by element number; both lists are empty under a linear law.
#[derive(Clone)]
pub(crate) struct States {
    law: Arc<dyn ConstitutiveLaw>,
    /// At the end of the last step.
    committed: Vec<f64>,
    /// At the end of this one, as of the last evaluation.
    trial: Vec<f64>,
    /// σ − D ε̃ of the last evaluation, Pa.
    beyond: Vec<Strain>,
    /// What the law has derived from each elasticity.
    moduli: Vec<f64>,
    /// What it has from each state for this step.
    prepared: Vec<f64>,
    step_s: f64,
    stiffening: f64,
}

/// The law with the states, and σ − D ε̃, of the elements from number `first` on.
pub(crate) struct StateRun<'a> {
    law: &'a dyn ConstitutiveLaw,
    step_s: f64,
    first: usize,
    committed: &'a [f64],
    trial: &'a mut [f64],
    beyond: &'a mut [Strain],
    moduli: &'a [f64],
    prepared: &'a [f64],
}

/// A law that answers for eight elements at once, with σ − D ε̃ and the moduli of those of a [`StateRun`].
pub(crate) struct PacketRun<'a> {
    pub law: &'a dyn PacketLaw,
    pub beyond: &'a mut [Strain],
    /// Of each element as many as `length`.
    pub moduli: &'a [f64],
    pub length: usize,
}

/// What a law knows of an element before it is strained.
#[derive(Clone, Copy)]
struct Known<'a> {
    moduli: &'a [f64],
    state: &'a [f64],
    prepared: &'a [f64],
    step_s: f64,
}

/// What a law is asked about an element.
pub(crate) struct Question<'a> {
    /// The element's number.
    pub number: usize,
    pub element: &'a Element,
    /// ε.
    pub strain: Strain,
    pub pressures: Option<&'a Pressures>,
}

impl Question<'_> {
    /// What a law sees of it; D ε̃, Pa; and the law's own growth, if it has one, with its derivative.
    fn put<'a>(
        &'a self,
        law: &dyn ConstitutiveLaw,
        known: Known<'a>,
    ) -> (MaterialPoint<'a>, Strain, Option<(f64, Strain)>) {
        let Self { number, element, strain, pressures } = self;
        let elasticity = &element.elasticity;
        let (Known { moduli, state, prepared, step_s }, pressure) = (known, None);
        let mut point = MaterialPoint {
            elasticity,
            moduli,
            strain: *strain,
            pressure,
            state,
            step_s,
            prepared,
        };
        let Some(pressures) = pressures else { return (point, elasticity * strain, None) };
        let growth = law.growth(strain);
        match growth {
            Some(_) => point.pressure = Some(pressures.mean_stress(*number, element.vertices)),
            None => point.strain = pressures.assumed_strain(*number, element.vertices, strain),
        }
        (point, pressures.stress(*number, element.vertices, strain), growth)
    }
}

impl<'a> StateRun<'a> {
    /// For the vector kernels, if the law can answer them; else itself.
    pub fn into_packets(self) -> Result<PacketRun<'a>, Self> {
        match self.law.packets().filter(|_| self.law.state_len() == 0) {
            Some(law) => {
                let Self { beyond, moduli, .. } = self;
                Ok(PacketRun { law, beyond, moduli, length: self.law.moduli_len() })
            }
            None => Err(self),
        }
    }

    /// σ of an element, with the state that it leaves, and by how much its growth is more than tr ε.
    pub fn stress(&mut self, question: &Question<'_>) -> (Strain, f64) {
        let i = question.number - self.first;
        let [n, m, p] = [self.law.state_len(), self.law.moduli_len(), self.law.prepared_len()];
        let known = Known {
            moduli: &self.moduli[m * i..][..m],
            state: &self.committed[n * i..][..n],
            prepared: &self.prepared[p * i..][..p],
            step_s: self.step_s,
        };
        let (point, linear, growth) = question.put(self.law, known);
        let stress = self.law.stress(&point, &mut self.trial[n * i..][..n]);
        self.beyond[i] = stress - linear;
        let dilation = question.strain.rows(0, 3).sum();
        (stress, growth.map_or(0.0, |(growth, _)| growth - dilation))
    }

    /// Adds what the law has beyond linear elasticity, V R (σ − D ε̃) ∇λ of each element with its
    /// rotation, to `forces`, and beyond tr ε to the `residuals` of pressures; returns Σ ‖·‖² of the elements'
    /// shares.
    pub fn add_to<'e>(
        mut self,
        elements: impl Iterator<Item = (&'e Element, Matrix3<f64>)>,
        pressures: Option<&Pressures>,
        turning: Turning,
        positions: &Field,
        forces: &mut Field,
        residuals: &mut [f64],
    ) -> f64 {
        let mut squares = 0.0;
        for (i, (element, rotation)) in elements.enumerate() {
            let strain = element.corotated_strain(&rotation, positions);
            let number = self.first + i;
            let (_, growth) = self.stress(&Question { number, element, strain, pressures });
            if let Some(pressures) = pressures {
                pressures.add_growth(number, element.vertices, growth, residuals);
            }
            let stress = stress_matrix(&self.beyond[i]);
            let stress = turning.stress(&stress, element, &rotation, positions);
            let scaled = rotation * stress;
            squares += element.add_forces(&(scaled * element.geometry.volume), forces);
        }
        squares
    }
}

impl Default for States {
    fn default() -> Self {
        Self::new(Arc::new(LinearElastic))
    }
}

impl fmt::Debug for States {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { committed, step_s, .. } = self;
        f.debug_struct(self.law.name()).field("state", committed).field("step_s", step_s).finish()
    }
}

impl States {
    pub fn new(law: Arc<dyn ConstitutiveLaw>) -> Self {
        let mut states = Self {
            law,
            committed: Vec::new(),
            trial: Vec::new(),
            beyond: Vec::new(),
            moduli: Vec::new(),
            prepared: Vec::new(),
            step_s: f64::INFINITY,
            stiffening: 1.0,
        };
        states.begin_step(f64::INFINITY, &[]);
        states
    }

    /// Those of no elements under the same law.
    pub fn emptied(&self) -> Self {
        Self::new(Arc::clone(&self.law))
    }

    pub fn law(&self) -> &dyn ConstitutiveLaw {
        self.law.as_ref()
    }

    pub fn stiffening(&self) -> f64 {
        self.stiffening
    }

    pub fn begin_step(&mut self, step_s: f64, elements: &[Element]) {
        self.step_s = step_s;
        self.stiffening = if self.law.is_linear() { 1.0 } else { self.law.stiffening(step_s) };
        let law = Arc::clone(&self.law);
        for (element, (moduli, state, prepared)) in elements.iter().zip(self.starts()) {
            let start = StepStart { elasticity: &element.elasticity, moduli, state, step_s };
            law.prepare(&start, prepared);
        }
    }

    /// Moduli, committed state and what is prepared of each element; nothing where the law prepares nothing.
    fn starts(&mut self) -> impl Iterator<Item = (&[f64], &[f64], &mut [f64])> {
        let [n, m, p] = [self.len(), self.law.moduli_len(), self.prepared_len()];
        let (moduli, committed) = (&self.moduli, &self.committed);
        let prepared = self.prepared.chunks_exact_mut(p.max(1)).enumerate();
        prepared
            .map(move |(i, prepared)| (&moduli[m * i..][..m], &committed[n * i..][..n], prepared))
    }

    pub fn commit(&mut self, elements: &[Element]) {
        let [n, m] = [self.len(), self.law.moduli_len()];
        for (i, element) in elements.iter().enumerate().filter(|_| n > 0) {
            let (moduli, state) = (&self.moduli[m * i..][..m], &self.committed[n * i..][..n]);
            let (elasticity, step_s) = (&element.elasticity, self.step_s);
            let start = StepStart { elasticity, moduli, state, step_s };
            self.law.finish(&start, &mut self.trial[n * i..][..n]);
        }
        self.committed.copy_from_slice(&self.trial);
    }

    /// Numbers per element.
    pub fn len(&self) -> usize {
        if self.law.is_linear() { 0 } else { self.law.state_len() }
    }

    fn prepared_len(&self) -> usize {
        if self.law.is_linear() { 0 } else { self.law.prepared_len() }
    }

    /// A state of zeros for one element more, of this elasticity, made of this besides.
    pub fn push(&mut self, elasticity: &Matrix6<f64>, made_of: &[f64]) {
        if self.law.is_linear() {
            return;
        }
        self.committed.resize(self.committed.len() + self.len(), 0.0);
        self.trial.resize(self.trial.len() + self.len(), 0.0);
        self.beyond.push(Strain::zeros());
        let at = self.moduli.len();
        self.moduli.resize(at + self.law.moduli_len(), 0.0);
        self.law.set_moduli(elasticity, made_of, &mut self.moduli[at..]);
        let [n, p] = [self.len(), self.prepared_len()];
        let (moduli, state) = (&self.moduli[at..], &self.committed[self.committed.len() - n..]);
        self.prepared.resize(self.prepared.len() + p, 0.0);
        let from = self.prepared.len() - p;
        let start = StepStart { elasticity, moduli, state, step_s: self.step_s };
        self.law.prepare(&start, &mut self.prepared[from..]);
    }

    /// The last element takes the place of element `at`.
    pub fn swap_remove(&mut self, at: usize) {
        if self.law.is_linear() {
            return;
        }
        self.beyond.swap_remove(at);
        let [n, m, p] = [self.len(), self.law.moduli_len(), self.prepared_len()];
        let Self { committed, trial, moduli, prepared, .. } = self;
        let lists = [(n, committed), (n, trial), (m, moduli), (p, prepared)];
        for (n, states) in lists {
            let last = states.len() - n;
            states.copy_within(last.., n * at);
            states.truncate(last);
        }
    }

    /// The committed state of an element.
    pub fn of(&self, number: usize) -> &[f64] {
        &self.committed[self.len() * number..][..self.len()]
    }

    /// σ − D ε̃ of an element at the last evaluation, Pa.
    pub fn beyond(&self, number: usize) -> Strain {
        self.beyond.get(number).copied().unwrap_or_else(Strain::zeros)
    }

    /// Sets the state of an element, and its σ − D ε̃.
    pub fn set(&mut self, element: (usize, &Element), state: &[f64], beyond: Strain) {
        let (number, Element { elasticity, .. }) = element;
        let [n, m, p] = [self.len(), self.law.moduli_len(), self.prepared_len()];
        self.committed[n * number..][..n].copy_from_slice(state);
        self.trial[n * number..][..n].copy_from_slice(state);
        self.beyond[number] = beyond;
        // Until the next step begins no time passes, as for elements that stay.
        let start =
            StepStart { elasticity, moduli: &self.moduli[m * number..][..m], state, step_s: 0.0 };
        self.law.prepare(&start, &mut self.prepared[p * number..][..p]);
    }

    /// The states of runs of `length` elements; none under a linear law.
    pub fn runs(&mut self, length: usize) -> impl Iterator<Item = StateRun<'_>> {
        let (n, step_s, law) = (self.len(), self.step_s, &*self.law);
        let (mut committed, mut trial) = (&self.committed[..], &mut self.trial[..]);
        let (m, mut moduli) = (law.moduli_len(), &self.moduli[..]);
        let (p, mut prepared) = (law.prepared_len(), &self.prepared[..]);
        let runs = self.beyond.chunks_mut(length.max(1)).enumerate();
        runs.map(move |(run, beyond)| {
            let states = ..n * beyond.len();
            let committed = committed.split_off(states).unwrap_or_default();
            let trial = trial.split_off_mut(states).unwrap_or_default();
            let moduli = moduli.split_off(..m * beyond.len()).unwrap_or_default();
            let prepared = prepared.split_off(..p * beyond.len()).unwrap_or_default();
            let first = length * run;
            StateRun { law, step_s, first, committed, trial, beyond, moduli, prepared }
        })
    }

    /// What the law stores in an element, J/m³, where it says so.
    pub fn energy(&self, question: &Question<'_>) -> Option<f64> {
        if self.law.is_linear() {
            return None;
        }
        self.law.energy(&question.put(self.law(), self.known(question.number)).0)
    }

    fn known(&self, number: usize) -> Known<'_> {
        let [m, p] = [self.law.moduli_len(), self.law.prepared_len()];
        Known {
            moduli: &self.moduli[m * number..][..m],
            state: self.of(number),
            prepared: &self.prepared[p * number..][..p],
            step_s: self.step_s,
        }
    }

    /// σ and ∂σ/∂ε̃ of an element, Pa, and the derivative of its growth by ε if that is the law's own.
    pub fn response(&self, question: &Question<'_>) -> (Strain, Matrix6<f64>, Option<Strain>) {
        let (point, _, growth) = question.put(self.law(), self.known(question.number));
        let mut trial = vec![0.0; self.len()];
        let stress = self.law.stress(&point, &mut trial);
        (stress, self.law.tangent(&point), growth.map(|(_, slope)| slope))
    }
}
