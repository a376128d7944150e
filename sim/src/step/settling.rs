//! Loads that follow the body, such as a pressure along its normals: solved for until they come to
//! rest with it.

use nalgebra::Vector3;
use yawara_corot::{Outcome, Tolerance};

/// Solves of one attempt at most while loads follow the body.
const SETTLINGS: usize = 40;

/// Whether loads that follow the body have come to rest with it.
pub(super) struct Settling<'a> {
    tolerance: &'a Tolerance,
    iterations: usize,
    evaluations: usize,
    rounds: usize,
    /// Iterations after which it ends.
    most: usize,
}

impl<'a> Settling<'a> {
    pub fn new(tolerance: &'a Tolerance, most: usize) -> Self {
        Self { tolerance, iterations: 0, evaluations: 0, rounds: 0, most }
    }

    /// Adds a solve under the loads `old`, which are `new` in its solution. Returns the sum of all
    /// when another solve would change nothing, or can't help.
    pub fn take(
        &mut self,
        solve: Outcome,
        old: &[Vector3<f64>],
        new: &[Vector3<f64>],
    ) -> Option<Outcome> {
        self.rounds += 1;
        self.iterations += solve.iterations;
        self.evaluations += solve.evaluations;
        let Self { iterations, evaluations, .. } = *self;
        let mut sum = Outcome { iterations, evaluations, ..solve };
        let change: f64 = old.iter().zip(new).map(|(a, b)| (a - b).norm_squared()).sum();
        let size: f64 = new.iter().map(Vector3::norm_squared).sum();
        if change.sqrt() <= self.tolerance.residual * size.sqrt() || !solve.converged {
            return Some(sum);
        }
        sum.converged = false;
        (self.rounds == SETTLINGS || iterations >= self.most).then_some(sum)
    }
}
