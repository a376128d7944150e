//! Newton's method on forces that have no energy: for loads that follow the body.

use super::iteration::Iteration;
use super::problem::Problem;
use super::solver::Equilibrium;
use super::tangent_system::{Kind, TangentSystem};
use crate::vectors::dot;

/// x ← x + α d, d = S⁻¹ r from the whole tangent S, that of the loads too and not symmetric, and α the first of
/// 1, ½, ¼ … for which ‖S⁻¹ r(x + α d)‖ ≤ (1 − α/4) ‖d‖: the natural test of monotonicity, which sees no scale of
/// forces, so that stiff elements hide nothing.
///
/// It finds equilibria, stable or not. Needs [`InternalForces::tangent`](crate::InternalForces::tangent); the
/// inverse of the [`Problem`] is not used. Cost: a sparse L U an iteration, a solve with it a trial.
/// # Source
/// Deuflhard, Newton methods for nonlinear problems, Springer 2004, section 3.3.
#[derive(Clone, Copy, Debug, Default)]
pub struct ResidualNewton;

/// Lengths tried at most.
const TRIALS: usize = 10;

impl Equilibrium for ResidualNewton {
    fn name(&self) -> &'static str {
        "residual_newton"
    }

    fn needs_tangent(&self) -> bool {
        true
    }

    fn takes_pushes(&self) -> bool {
        true
    }

    fn takes_following(&self) -> bool {
        true
    }

    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        let mut system = TangentSystem::new(problem, Kind::Whole, None);
        while point.goes_on() && point.is_on_its_way() {
            point.begin_iteration();
            if system.renew(problem, point.positions).is_none() {
                break;
            }
            let step = system.solve(&point.residual);
            if !search(problem, point, &system, &step) {
                break;
            }
            point.keep_if_best(problem);
        }
    }
}

/// Moves `point` along `step`; false, with `point` where it was, if no length passes.
fn search(
    problem: &mut Problem<'_>,
    point: &mut Iteration<'_>,
    system: &TangentSystem<'_>,
    step: &[f64],
) -> bool {
    let start = problem.iterate(point.positions);
    let size = dot(step, step).sqrt();
    let mut length = 1.0;
    for _ in 0..TRIALS {
        problem.return_to(&start, point.positions);
        point.advance(problem, step, length);
        if point.is_solved() {
            return true;
        }
        let next = system.solve(&point.residual);
        if dot(&next, &next).sqrt() <= (1.0 - 0.25 * length) * size {
            return true;
        }
        length *= 0.5;
    }
    problem.return_to(&start, point.positions);
    point.evaluate(problem);
    false
}
