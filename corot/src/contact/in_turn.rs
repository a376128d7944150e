//! Positions under given contact forces, then forces by the gaps, in turn.

use nalgebra::Vector3;

use super::run::{Place, Run};
use crate::equilibrium::anderson::MIN_DAMPING;
use crate::equilibrium::problem::Equilibrium;

/// Solves under given contact forces at most.
const TURNS: usize = 40;

impl Run<'_, '_, '_> {
    /// Positions under given forces, then forces by the gaps, in turn.
    pub(super) fn in_turn(
        &mut self,
        equilibrium: &mut dyn Equilibrium,
        positions: &mut [Vector3<f64>],
    ) {
        self.fallbacks = 1;
        let mut best: Option<Place> = None;
        let mut damping = 1.0;
        for _ in 0..TURNS {
            let mut loaded = self.problem.with_loads(&self.loads);
            let solved = equilibrium.solve(&mut loaded, positions, self.internal, self.tolerance);
            self.iterations += solved.iterations;
            self.evaluations += solved.evaluations;
            self.evaluate(positions);
            let merit = self.merit();
            match &best {
                Some(least) if !(merit < least.0) => {
                    damping *= 0.5;
                    let least = least.clone();
                    self.return_to(&least, positions);
                }
                _ => best = Some((merit, self.problem.iterate(positions), self.lambda.clone())),
            }
            if merit <= 1.0 || damping < MIN_DAMPING {
                break;
            }
            let mut moves = vec![0.0; self.residual.len()];
            let renewed = self.forces_by_gaps(&moves);
            let damped: Vec<f64> = renewed
                .iter()
                .zip(&self.lambda)
                .map(|(new, old)| old + damping * (new - old))
                .collect();
            self.add_push(&damped, &mut moves);
            self.problem.advance(positions, &moves, 1.0);
            self.lambda = damped;
            self.evaluate(positions);
        }
    }
}
