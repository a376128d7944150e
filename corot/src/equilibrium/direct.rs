//! `direct`: the warped inverse, applied as it is.

use super::iteration::Iteration;
use super::problem::Problem;
use super::solver::Equilibrium;

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

    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        let (mut scratch, mut step) = (vec![0.0; problem.rows()], vec![0.0; problem.rows()]);
        while point.goes_on() && point.is_within(GROWTH) {
            problem.precondition(&point.residual, &mut scratch, &mut step);
            point.begin_iteration();
            point.advance(problem, &step, 1.0);
            point.keep_if_best(problem);
        }
    }
}
