//! Where an iteration stands, and the best place it has been at.

use yawara_embed::SparseLdl;

use super::problem::{Iterate, Outcome, Problem, Tolerance};
use crate::field::Field;

/// Iterations over which progress is judged.
const WINDOW: usize = 20;

/// Positions with their forces and residual, the best iterate so far, and the count of work.
pub struct Iteration<'a> {
    /// m.
    pub positions: &'a mut Field,
    /// N.
    pub internal: &'a mut Field,
    /// As [`Problem::evaluate`] gives it.
    pub residual: Vec<f64>,
    /// Its relative size.
    pub size: f64,
    /// The first iterate's.
    first: f64,
    /// When to stop.
    pub tolerance: &'a Tolerance,
    iterations: usize,
    evaluations: usize,
    /// Iterations and evaluations before it began anew, and of solves that it made use of.
    before: (usize, usize),
    /// The least size when each iteration began.
    sizes: Vec<f64>,
    /// P of a mixed body whose pressures follow its displacements.
    pressures: Option<SparseLdl>,
    /// The least size among the iterates, and the iterate.
    best: (f64, Iterate),
}

impl<'a> Iteration<'a> {
    /// The first iterate: where `positions` are.
    pub(super) fn new(
        problem: &mut Problem<'_>,
        positions: &'a mut Field,
        internal: &'a mut Field,
        tolerance: &'a Tolerance,
    ) -> Self {
        let mut residual = vec![0.0; problem.rows()];
        let size = problem.evaluate(positions, internal, &mut residual, tolerance);
        let best = (size, problem.iterate(positions));
        Self {
            positions,
            internal,
            residual,
            size,
            first: size,
            tolerance,
            iterations: 0,
            evaluations: 1,
            before: (0, 0),
            sizes: Vec::new(),
            pressures: None,
            best,
        }
    }

    /// Whether another iteration is wanted and allowed. A residual that is no number is not small.
    pub fn goes_on(&self) -> bool {
        !self.is_solved()
            && self.iterations < self.tolerance.max_iterations
            && !self.tolerance.is_late()
    }

    /// Whether the residual has fallen in the last 20 iterations by so much that it will be as small as
    /// asked for in those that are left, if it goes on like that.
    pub fn is_on_its_way(&self) -> bool {
        let Some(before) = self.sizes.len().checked_sub(WINDOW) else { return true };
        let left = self.tolerance.max_iterations.saturating_sub(self.iterations);
        let windows = left as f64 / WINDOW as f64;
        let fall = self.best.0 / self.sizes[before];
        self.best.0 * fall.powf(windows) <= self.tolerance.residual
    }

    /// Whether the residual is as small as asked for.
    pub fn is_solved(&self) -> bool {
        self.size <= self.tolerance.residual
    }

    /// Whether the residual is at most `factor` times the least so far.
    pub fn is_within(&self, factor: f64) -> bool {
        self.size <= factor * self.best.0
    }

    /// Counts an application of the inverse, or of a factor.
    pub fn begin_iteration(&mut self) {
        self.iterations += 1;
        self.sizes.push(self.best.0);
    }

    /// Allows as many iterations again.
    pub(super) fn begin_anew(&mut self) {
        self.before.0 += std::mem::take(&mut self.iterations);
    }

    /// Counts the work of another solve.
    pub(super) fn count(&mut self, other: &Outcome) {
        self.before.0 += other.iterations;
        self.before.1 += other.evaluations;
    }

    /// Renews forces, residual and its size where the positions are.
    pub fn evaluate(&mut self, problem: &mut Problem<'_>) {
        self.measure(problem);
        if let Some(matrix) = &self.pressures {
            problem.body.settle_pressures(matrix);
            self.measure(problem);
        }
    }

    fn measure(&mut self, problem: &mut Problem<'_>) {
        self.size =
            problem.evaluate(self.positions, self.internal, &mut self.residual, self.tolerance);
        self.evaluations += 1;
    }

    /// From now on pressures of a [mixed](crate::Body::mixed) body follow its displacements, P q = G u: at twice
    /// the evaluations.
    pub(super) fn settle_pressures(&mut self, problem: &mut Problem<'_>) {
        self.pressures = problem.body.pressure_matrix();
        if self.pressures.is_some() {
            self.evaluate(problem);
            self.keep_if_best(problem);
        }
    }

    /// x ← x + `length` · `step`, with its forces.
    pub fn advance(&mut self, problem: &mut Problem<'_>, step: &[f64], length: f64) {
        problem.advance(self.positions, step, length);
        self.evaluate(problem);
    }

    /// Remembers this iterate if it is the best so far.
    pub fn keep_if_best(&mut self, problem: &Problem<'_>) {
        if self.size < self.best.0 {
            self.best = (self.size, problem.iterate(self.positions));
        }
    }

    /// Goes back to the best iterate.
    pub fn return_to_best(&mut self, problem: &mut Problem<'_>) {
        problem.return_to(&self.best.1, self.positions);
        self.evaluate(problem);
    }

    /// Ends at the best iterate.
    pub(super) fn finish(mut self, problem: &mut Problem<'_>, method: &'static str) -> Outcome {
        if !self.is_within(1.0) {
            self.return_to_best(problem);
        }
        Outcome {
            iterations: self.iterations + self.before.0,
            evaluations: self.evaluations + self.before.1,
            first: self.first,
            residual: self.size,
            converged: self.is_solved(),
            method,
            fallbacks: 0,
        }
    }
}
