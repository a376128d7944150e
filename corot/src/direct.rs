//! `direct`: the warped inverse, applied as it is.

use nalgebra::Vector3;

use crate::equilibrium::{Equilibrium, Outcome, Problem, Tolerance};

/// x ← x + T C Tᵀ(f_ext − f_int(x)), nothing else: for eq. (2) of the paper that is its own
/// x = T(X + C T⁻¹f). One iteration is exact without co-rotation, a second one takes out its
/// rounding; with it the iteration diverges as soon as rotations differ by some degrees.
///
/// Ends when the residual is not finite or a thousand times the least. Cost: one solve and one
/// force evaluation an iteration. Source: Oishi et al., eq. (2).
#[derive(Clone, Copy, Debug, Default)]
pub struct Direct;

/// Residuals this far above the least one do not come back.
const GROWTH: f64 = 1e3;

impl Equilibrium for Direct {
    fn name(&self) -> &'static str {
        "direct"
    }

    fn solve(
        &mut self,
        problem: &mut Problem<'_>,
        positions: &mut [Vector3<f64>],
        internal: &mut [Vector3<f64>],
        tolerance: &Tolerance,
    ) -> Outcome {
        let n = problem.rows();
        let (mut residual, mut scratch, mut step) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut size = problem.evaluate(positions, internal, &mut residual, tolerance);
        let mut best = (size, problem.iterate(positions));
        let (mut iterations, mut evaluations) = (0, 1);
        while !(size <= tolerance.residual)
            && iterations < tolerance.max_iterations
            && size <= GROWTH * best.0
        {
            problem.precondition(&residual, &mut scratch, &mut step);
            problem.advance(positions, &step, 1.0);
            iterations += 1;
            size = problem.evaluate(positions, internal, &mut residual, tolerance);
            evaluations += 1;
            if size < best.0 {
                best.0 = size;
                best.1 = problem.iterate(positions);
            }
        }
        if !(size <= best.0) {
            problem.return_to(&best.1, positions);
            size = problem.evaluate(positions, internal, &mut residual, tolerance);
            evaluations += 1;
        }
        Outcome {
            iterations,
            evaluations,
            residual: size,
            converged: size <= tolerance.residual,
            method: self.name(),
            fallbacks: 0,
        }
    }
}
