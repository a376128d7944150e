//! `newton`: down the energy with its exact second derivative.

use super::iteration::Iteration;
use super::line_search::{LONGEST, search};
use super::problem::{Problem, Tolerance};
use super::solver::Equilibrium;
use super::tangent_system::{Kind, Pattern, TangentSystem};
use crate::vectors::dot;

/// x ← x + α d, d from the tangent with the derivatives of the rotations, α by a line search: what goes down
/// in energy from anywhere, quadratic near the solution.
///
/// d is Newton's where the tangent is positive definite, by its own factor; else what conjugate gradients, preconditioned
/// by the positive semi-definite parts of the elements' tangents, find up to the first direction that curves down, and
/// along that one. Whether it is definite is tried by factoring it, less often the more often it was not; one that
/// is not serves two directions if the first has led about as far as it said and no obstacle pushes.
/// In a [mixed](crate::Body::mixed) body pressures follow displacements, q = P⁻¹G u, which makes the energy one of
/// displacements alone. Where it does not arrive, and the law is linear, bodies whose stiff elements are no more
/// than 10, 10³, … times as stiff as the softest are solved before; at once where they differ by more than 10⁷. Needs [`InternalForces::tangent`](crate::InternalForces::tangent), symmetric; the
/// inverse of the [`Problem`] is not used. Cost: one or two sparse factorisations an iteration; where the factor has entries
/// is kept for the next solve.
/// # Source
/// Steihaug, The conjugate gradient method and trust regions in large scale optimization, SIAM J. Numer. Anal.
/// 20(3), 1983; Teran et al., Robust quasistatic finite elements and flesh simulation, SCA 2005 (the
/// semi-definite parts); Chao, Pinkall, Sanan, Schröder, A simple geometric model for elastic deformations, ACM
/// TOG 29(4), 2010 (the energy).
#[derive(Default)]
pub struct Newton {
    kept: Option<Pattern>,
}

/// In so many iterations with a tangent of their own what a step promises of the energy has to fall to [`ENOUGH`] of the least before: a residual
/// is that of stiff elements, whatever soft ones still have before them. It is counted anew from where the slope goes
/// on down far beyond a step: what was promised there was that of a saddle.
const PATIENCE: usize = 25;

const ENOUGH: f64 = 0.5;

/// A tangent may serve again after a step of this many of its directions.
const AS_SAID: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// What a step may leave of the slope along it.
const FLAT: f64 = 0.1;

/// Each of these is the bound on the elements' stiffness, over that of the softest, of a body solved before the true
/// one where that alone does not converge.
const BOUNDS: [f64; 6] = [1e1, 1e3, 1e5, 1e7, 1e9, 1e11];

/// Where elements differ by more than this in stiffness, softer bodies are solved first and not only when the true one alone
/// has not converged.
const SOFTENED_FIRST: f64 = 1e7;

/// Relative residual and iterations of such a solve.
const ROUGH: Tolerance = Tolerance::new(1e-2, 30);

impl Equilibrium for Newton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn needs_tangent(&self) -> bool {
        true
    }

    fn takes_pushes(&self) -> bool {
        true
    }

    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        let start = problem.iterate(point.positions);
        point.settle_pressures(problem);
        let [softest, stiffest] = problem.body.stiffness_range();
        let bounds = BOUNDS.map(|bound| bound * softest).into_iter().filter(|b| *b < stiffest);
        let bounds: Vec<f64> = bounds.collect();
        // Whether softer bodies are solved before: in the first try, and in the second.
        let ways: &[bool] = match problem.body.law().is_linear() && !bounds.is_empty() {
            false => &[false],
            true if stiffest > SOFTENED_FIRST * softest => &[true, false],
            true => &[false, true],
        };
        for (number, is_softened) in ways.iter().enumerate() {
            if point.is_solved() {
                return;
            }
            if number > 0 {
                problem.return_to(&start, point.positions);
                point.begin_anew();
                point.evaluate(problem);
            }
            if *is_softened {
                self.soften(problem, point, &bounds);
            }
            self.descend(problem, point);
        }
    }
}

impl Newton {
    /// Moves to where bodies would be whose elements are no stiffer than each of the bounds (Pa), one after the other.
    fn soften(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>, bounds: &[f64]) {
        let rough = Tolerance { deadline: point.tolerance.deadline, ..ROUGH };
        for &bound in bounds {
            let mut softened = problem.body.softened(bound);
            let mut soft = problem.with_body(&mut softened);
            let mut internal = point.internal.to_vec();
            let mut inner = Iteration::new(&mut soft, point.positions, &mut internal, &rough);
            inner.settle_pressures(&mut soft);
            self.descend(&mut soft, &mut inner);
            let outcome = inner.finish(&mut soft, self.name());
            point.count(&outcome);
        }
        point.evaluate(problem);
    }

    /// Goes down in energy to an equilibrium or to where that takes too long.
    fn descend(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        let mut least = vec![f64::INFINITY];
        let mut length = 0.0;
        let mut system = TangentSystem::new(problem, Kind::Convex, self.kept.take());
        while point.goes_on() {
            point.begin_iteration();
            // Which points obstacles push changes from step to step.
            let as_said = problem.pushes.is_none() && AS_SAID.contains(&length);
            let serves_again = as_said && system.serves_again();
            if !serves_again && system.renew(problem, point.positions).is_none() {
                break;
            }
            let accuracy = point.size.sqrt().clamp(1e-3, 0.1);
            let direction = system.direction(&point.residual, accuracy);
            let promise = dot(&point.residual, &direction);
            length = search(problem, point, &direction, FLAT);
            if !(length > 0.0) {
                length = search(problem, point, &system.solve(&point.residual), FLAT);
            }
            if !(length > 0.0) {
                break;
            }
            point.keep_if_best(problem);
            if length >= LONGEST {
                least.truncate(1);
                continue;
            }
            if serves_again {
                continue;
            }
            let before = least.len().checked_sub(PATIENCE).map(|at| least[at]);
            least.push(promise.min(least[least.len() - 1]));
            if before.is_some_and(|before| least[least.len() - 1] > ENOUGH * before) {
                break;
            }
        }
        self.kept = system.into_pattern();
    }
}
