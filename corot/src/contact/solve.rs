//! Equilibrium in the way of obstacles: they push, and never pull.

use super::run::{Place, Run};
use super::surface_contact::{Contact, ContactOutcome};
use crate::equilibrium::anderson::MIN_DAMPING;
use crate::equilibrium::{Equilibrium, Problem, Tolerance};
use crate::field::Field;

/// Solves under given contact forces at most.
const TURNS: usize = 40;

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
/// iteration gives up, `equilibrium` solves under contact forces that stay as they are, and between
/// its solves they follow the gaps, 0 ≤ λ' ⊥ h + G Ĉ Gᵀ(λ' − λ) ≥ 0;
/// [`Outcome::fallbacks`](crate::Outcome::fallbacks) then
/// counts it.
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
    if !run.together(&start, positions) {
        run.return_to(&start, positions);
        run.in_turn(equilibrium, positions);
    }
    run.into_outcome()
}

impl Run<'_, '_, '_> {
    /// Positions under given forces, then forces by the gaps, in turn.
    fn in_turn(&mut self, equilibrium: &mut dyn Equilibrium, positions: &mut Field) {
        self.outcome.fallbacks = 1;
        let mut best: Option<Place> = None;
        let mut damping = 1.0;
        for _ in 0..TURNS {
            let mut loaded = self.problem.with_loads(&self.loads);
            let solved = equilibrium.solve(&mut loaded, positions, self.internal, self.tolerance);
            self.outcome.iterations += solved.iterations;
            self.outcome.evaluations += solved.evaluations;
            self.evaluate(positions);
            let merit = self.merit();
            match &best {
                Some(least) if !(merit < least.0) => {
                    damping *= 0.5;
                    self.return_to(least, positions);
                }
                _ => best = Some(self.place(merit, positions)),
            }
            if merit <= 1.0 || damping < MIN_DAMPING {
                break;
            }
            let mut moves = vec![0.0; self.residual.len()];
            let renewed = self.forces_by_gaps(&moves);
            let damped =
                self.lambda.iter().zip(renewed).map(|(old, new)| old + damping * (new - old));
            let damped: Vec<f64> = damped.collect();
            self.add_push(&damped, &mut moves);
            self.problem.advance(positions, &moves, 1.0);
            self.lambda = damped;
            self.evaluate(positions);
        }
    }
}
