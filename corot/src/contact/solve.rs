//! Equilibrium in the way of obstacles: they push, and never pull.

use super::pushes::Pushes;
use super::run::Run;
use super::surface_contact::{Contact, ContactOutcome};
use crate::equilibrium::{Equilibrium, Problem, Tolerance};
use crate::field::Field;

/// Solves against springs at most.
const TURNS: usize = 12;

/// κ of a point, over its own stiffness.
const STIFF: f64 = 10.0;

/// κ grows by this where a solve left more than a quarter of what was too deep or too far.
const STIFFER: f64 = 10.0;

/// Finds x and λ with f_int(x) = f_ext + Σ λ_i n_i w_i, gap_i(x) ≥ 0, λ_i ≥ 0 and λ_i gap_i = 0.
///
/// With Ĉ = T C Tᵀ, G the gaps' gradients, r the residual and h the gaps, an iteration solves
/// 0 ≤ λ' ⊥ h + G Ĉ r + G Ĉ Gᵀ(λ' − λ) ≥ 0 and steps to x + Ĉ(r + Gᵀ(λ' − λ)) and λ', both mixed as
/// in [`Anderson`](crate::Anderson): at a fixed point r = 0 and the conditions hold, whatever Ĉ is.
/// `multipliers` begin it (those of the last solve, or zeros; one per point). It has converged when
/// the relative residual is at most `tolerance.residual` and no point is deeper than
/// `contact.depth` or pushed from farther away.
///
/// Mixing is for smooth maps: its memory goes when a point comes in or goes out. Where that happens
/// again and again the set of points that push is settled first, with forces of either sign on them
/// and none on the others, and renewed by the signs of forces and gaps in its solution. Where this
/// iteration gives up, and `equilibrium` [takes them](Equilibrium::takes_pushes), obstacles push with springs
/// ([`Pushes`]) in solves of it, and between these λ becomes what they pushed with;
/// [`Outcome::fallbacks`](crate::Outcome::fallbacks) then counts it.
///
/// Cost: two applications of the inverse and a force evaluation an iteration, and O(k² + k v) for k
/// points of v vertices. On return `internal` holds the internal forces.
/// # Source
/// Duriez, Dubois, Kheddar, Andriot, Realistic haptic rendering of interacting deformable objects
/// in virtual environments, IEEE TVCG 12(1), 2006 (compliance at the contacts, Gauss-Seidel).
pub fn solve_with_contact(
    problem: &mut Problem<'_>,
    equilibrium: &mut dyn Equilibrium,
    contact: &Contact<'_>,
    multipliers: &[f64],
    positions: &mut Field,
    internal: &mut Field,
    tolerance: &Tolerance,
) -> ContactOutcome {
    let mut run = Run::new(problem, contact, multipliers, internal, tolerance);
    run.evaluate(positions);
    let start = run.place(run.merit(), positions);
    let is_done = run.together(&start, positions) || tolerance.is_late();
    if !is_done && equilibrium.takes_pushes() {
        run.against_springs(equilibrium, positions);
    }
    run.into_outcome()
}

impl Run<'_, '_, '_> {
    /// Positions against springs, then forces by what these push with, in turn: the augmented Lagrangian.
    fn against_springs(&mut self, equilibrium: &mut dyn Equilibrium, positions: &mut Field) {
        self.outcome.fallbacks = 1;
        self.renew_compliance();
        let (k, compliance) = (self.lambda.len(), self.compliance.clone());
        let own = |i: usize| compliance[(k + 1) * i];
        let spring = |i: usize| if own(i) > 0.0 { STIFF / own(i) } else { 0.0 };
        let mut stiffness: Vec<f64> = (0..k).map(spring).collect();
        let mut off = f64::INFINITY;
        for _ in 0..TURNS {
            let lambda = self.lambda.clone();
            let Contact { points, obstacles, .. } = *self.contact;
            let pushes = Pushes { points, obstacles, multipliers: &lambda, stiffness: &stiffness };
            let mut pushed = self.problem.with_pushes(&pushes);
            let solved = equilibrium.solve(&mut pushed, positions, self.internal, self.tolerance);
            self.outcome.iterations += solved.iterations;
            self.outcome.evaluations += solved.evaluations;
            for (i, force) in self.lambda.iter_mut().enumerate() {
                *force = pushes.force(i, positions).0;
            }
            self.evaluate(positions);
            let left = self.merit();
            if left <= 1.0 || !solved.converged {
                break;
            }
            if !(left <= 0.25 * off) {
                stiffness.iter_mut().for_each(|stiffness| *stiffness *= STIFFER);
            }
            off = left;
        }
    }
}
