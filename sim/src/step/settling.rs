//! Loads that follow the body, such as a pressure along its normals: solved for until they come to
//! rest with it.

use nalgebra::Vector3;
use yawara_corot::{Outcome, Tolerance};

/// Solves of one attempt at most while loads follow the body.
const SETTLINGS: usize = 40;

/// Whether loads that follow the body have come to rest with it.
pub(super) struct Settling<'a> {
    tolerance: &'a Tolerance,
    total: Option<Outcome>,
    rounds: usize,
}

impl<'a> Settling<'a> {
    pub fn new(tolerance: &'a Tolerance) -> Self {
        Self { tolerance, total: None, rounds: 0 }
    }

    /// Adds a solve under the loads `old`, which are `new` in its solution. Returns the sum of all
    /// when another solve would change nothing, or can't help.
    pub fn take(
        &mut self,
        solve: Outcome,
        old: &[Vector3<f64>],
        new: &[Vector3<f64>],
    ) -> Option<Outcome> {
        let (iterations, evaluations) =
            self.total.map_or((0, 0), |total| (total.iterations, total.evaluations));
        self.rounds += 1;
        let mut sum = Outcome {
            iterations: iterations + solve.iterations,
            evaluations: evaluations + solve.evaluations,
            ..solve
        };
        self.total = Some(sum);
        let change: f64 = old.iter().zip(new).map(|(a, b)| (a - b).norm_squared()).sum();
        let size: f64 = new.iter().map(Vector3::norm_squared).sum();
        if change.sqrt() <= self.tolerance.residual * size.sqrt() || !solve.converged {
            return Some(sum);
        }
        sum.converged = false;
        (self.rounds == SETTLINGS).then_some(sum)
    }
}
