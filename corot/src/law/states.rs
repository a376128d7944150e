//! The states of all elements of a body under its law.

use std::fmt;
use std::sync::Arc;

use nalgebra::Matrix6;
use yawara_embed::Strain;

use super::constitutive_law::{ConstitutiveLaw, MaterialPoint};
use super::linear::LinearElastic;
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
}

impl StateRun<'_> {
    /// σ of its element `i`, with the state that it leaves.
    pub fn stress(&mut self, i: usize, elasticity: &Matrix6<f64>, strain: Strain) -> Strain {
        let (n, step_s) = (self.law.state_len(), self.step_s);
        let state = &self.committed[n * i..n * (i + 1)];
        let point = MaterialPoint { elasticity, strain, state, step_s };
        let stress = self.law.stress(&point, &mut self.trial[n * i..n * (i + 1)]);
        self.beyond[i] = stress - elasticity * strain;
        stress
    }

    /// Adds what the law has beyond linear elasticity, V R (σ − D ε̃) ∇λ of each element with its
    /// rotation, to `forces`; returns Σ ‖·‖² of the elements' shares.
    pub fn add_to(
        mut self,
        elements: &[Element],
        pressures: Option<&Pressures>,
        turning: Turning,
        positions: &Field,
        forces: &mut Field,
    ) -> f64 {
        let mut squares = 0.0;
        for (i, element) in elements.iter().enumerate() {
            let mut strain = element.corotated_strain(positions);
            if let Some(pressures) = pressures {
                strain = pressures.assumed_strain(self.first + i, element.vertices, &strain);
            }
            self.stress(i, &element.elasticity, strain);
            let stress = turning.stress(&stress_matrix(&self.beyond[i]), element, positions);
            let scaled = element.rotation * stress;
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
            step_s: f64::INFINITY,
            stiffening: 1.0,
        };
        states.begin_step(f64::INFINITY);
        states
    }

    pub fn law(&self) -> &dyn ConstitutiveLaw {
        self.law.as_ref()
    }

    pub fn stiffening(&self) -> f64 {
        self.stiffening
    }

    pub fn begin_step(&mut self, step_s: f64) {
        self.step_s = step_s;
        self.stiffening = if self.law.is_linear() { 1.0 } else { self.law.stiffening(step_s) };
    }

    pub fn commit(&mut self) {
        self.committed.copy_from_slice(&self.trial);
    }

    /// Numbers per element.
    pub fn len(&self) -> usize {
        if self.law.is_linear() { 0 } else { self.law.state_len() }
    }

    /// A state of zeros for one element more.
    pub fn push(&mut self) {
        if !self.law.is_linear() {
            self.committed.resize(self.committed.len() + self.len(), 0.0);
            self.trial.resize(self.trial.len() + self.len(), 0.0);
            self.beyond.push(Strain::zeros());
        }
    }

    /// The last element takes the place of element `at`.
    pub fn swap_remove(&mut self, at: usize) {
        if self.law.is_linear() {
            return;
        }
        self.beyond.swap_remove(at);
        let n = self.len();
        for states in [&mut self.committed, &mut self.trial] {
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
    pub fn set(&mut self, number: usize, state: &[f64], beyond: Strain) {
        let n = self.len();
        self.committed[n * number..][..n].copy_from_slice(state);
        self.trial[n * number..][..n].copy_from_slice(state);
        self.beyond[number] = beyond;
    }

    /// The states of runs of `length` elements; none under a linear law.
    pub fn runs(&mut self, length: usize) -> impl Iterator<Item = StateRun<'_>> {
        let (n, step_s, law) = (self.len(), self.step_s, &*self.law);
        let (mut committed, mut trial) = (&self.committed[..], &mut self.trial[..]);
        let runs = self.beyond.chunks_mut(length.max(1)).enumerate();
        runs.map(move |(run, beyond)| {
            let states = ..n * beyond.len();
            let committed = committed.split_off(states).unwrap_or_default();
            let trial = trial.split_off_mut(states).unwrap_or_default();
            StateRun { law, step_s, first: length * run, committed, trial, beyond }
        })
    }

    /// What the law sees of an element.
    pub fn point<'a>(
        &'a self,
        number: usize,
        elasticity: &'a Matrix6<f64>,
        strain: Strain,
    ) -> MaterialPoint<'a> {
        MaterialPoint { elasticity, strain, state: self.of(number), step_s: self.step_s }
    }
}
