//! `fallback`: one method after the other.

use super::iteration::Iteration;
use super::problem::{Outcome, Problem, Tolerance};
use super::solver::Equilibrium;
use crate::field::Field;

/// Tries its methods in turn until one converges, each from where the solve began unless the
/// methods before have come closer. In a [mixed](crate::Body::mixed) body those are left out that
/// [need an energy](Equilibrium::needs_definite); one that needs a tangent ends at once where forces have
/// none.
///
/// What is left to the caller when none does is a smaller step. [`Outcome`] tells which method
/// ended it; iterations are those of all. With each method the budget of iterations begins anew.
pub struct Fallback {
    name: &'static str,
    methods: Vec<Box<dyn Equilibrium>>,
    of_following: Vec<Box<dyn Equilibrium>>,
}

impl Fallback {
    /// A chain under a scene name. An empty one only measures the residual.
    pub fn new(name: &'static str, methods: Vec<Box<dyn Equilibrium>>) -> Self {
        Self { name, methods, of_following: Vec::new() }
    }

    /// With other methods for loads that follow the body.
    #[must_use]
    pub fn with_following(self, of_following: Vec<Box<dyn Equilibrium>>) -> Self {
        Self { of_following, ..self }
    }
}

/// The next method starts at the last one's best iterate if its residual is this small a part of
/// the first one; farther away a small residual may be that of a tangled body.
pub(crate) const CLOSER: f64 = 0.1;

impl Equilibrium for Fallback {
    fn name(&self) -> &'static str {
        self.name
    }

    fn needs_tangent(&self) -> bool {
        self.methods.iter().all(|method| method.needs_tangent())
    }

    fn needs_definite(&self) -> bool {
        self.methods.iter().all(|method| method.needs_definite())
    }

    fn takes_pushes(&self) -> bool {
        self.methods.iter().any(|method| method.takes_pushes())
    }

    fn takes_following(&self) -> bool {
        !self.of_following.is_empty()
    }

    fn solve(
        &mut self,
        problem: &mut Problem<'_>,
        positions: &mut Field,
        internal: &mut Field,
        tolerance: &Tolerance,
    ) -> Outcome {
        let start = problem.iterate(positions);
        let mut total = Outcome { method: self.name, ..Outcome::default() };
        let mut has_begun = false;
        let mixed = problem.body.is_mixed();
        let pushed = problem.pushes.is_some();
        let methods = match problem.following {
            [] => &mut self.methods,
            _ => &mut self.of_following,
        };
        let able = methods.iter_mut().filter(|method| {
            !(mixed && method.needs_definite()) && (!pushed || method.takes_pushes())
        });
        for (number, method) in able.enumerate() {
            // What is late stays where it has come to.
            if has_begun && (total.converged || tolerance.is_late()) {
                break;
            }
            if has_begun && !(total.residual <= CLOSER * total.first) {
                problem.return_to(&start, positions);
            }
            let outcome = method.solve(problem, positions, internal, tolerance);
            total = Outcome {
                iterations: total.iterations + outcome.iterations,
                evaluations: total.evaluations + outcome.evaluations,
                first: if has_begun { total.first } else { outcome.first },
                fallbacks: number,
                ..outcome
            };
            has_begun = true;
        }
        if !has_begun {
            let point = Iteration::new(problem, positions, internal, tolerance);
            total = point.finish(problem, self.name);
        } else if total.converged && total.iterations == 0 {
            // None of them had anything to do.
            total.method = self.name;
        }
        total
    }
}
