//! What a law has beyond linear elasticity, added to the forces of a run of elements.

use nalgebra::Vector3;

use super::constitutive_law::MaterialPoint;
use super::states::StateRun;
use crate::element::Element;
use crate::element::pressures::Pressures;
use crate::element::stress::{add_forces, stress_matrix};

/// A pass over the elements from number `first` on, after their rotations have been renewed.
pub(crate) struct LawPass<'a> {
    pub elements: &'a [Element],
    pub first: usize,
    /// Of mixed elements.
    pub pressures: Option<&'a Pressures>,
    /// Of these elements.
    pub states: StateRun<'a>,
}

impl LawPass<'_> {
    /// Adds V R (σ − D ε̃) ∇λ of each element to `forces`; returns Σ ‖·‖² of the elements' shares.
    pub fn add_to(self, positions: &[Vector3<f64>], forces: &mut [Vector3<f64>]) -> f64 {
        let StateRun { law, step_s, committed, trial, beyond } = self.states;
        let n = law.state_len();
        let mut squares = 0.0;
        for (i, element) in self.elements.iter().enumerate() {
            let mut strain = element.corotated_strain(positions);
            if let Some(pressures) = self.pressures {
                strain = pressures.assumed_strain(self.first + i, element.vertices, &strain);
            }
            let (elasticity, at) = (&element.elasticity, n * i..n * (i + 1));
            let point = MaterialPoint { elasticity, strain, state: &committed[at.clone()], step_s };
            let stress = law.stress(&point, &mut trial[at]);
            beyond[i] = stress - elasticity * strain;
            let scaled = element.rotation * stress_matrix(&beyond[i]) * element.geometry.volume;
            squares += add_forces(element, &scaled, forces);
        }
        squares
    }
}
