//! Positions and contact forces in one iteration.

use super::run::{Place, Run};
use crate::equilibrium::anderson::{Anderson, MIN_DAMPING, Memory};
use crate::equilibrium::fallback::CLOSER;
use crate::field::Field;

/// Changes of the set of points that push, in one solve, after which the set is settled first.
const FLIPS: usize = 3;

/// Iterations in which what is left has to become half at least.
const PATIENCE: usize = 20;

impl Run<'_, '_, '_> {
    /// Positions and forces in one iteration; true if it has converged. Else it stands where another may begin: at
    /// `start`, or at the best iterate where that is much closer, or where it is late.
    pub(super) fn together(&mut self, start: &Place, positions: &mut Field) -> bool {
        let Anderson { depth, growth } = Anderson::default();
        let mut memory = Memory::new(depth);
        let mut damping = 1.0;
        let mut best = start.clone();
        let mut step = vec![0.0; self.residual.len() + self.lambda.len()];
        let mut pushing: Vec<bool> = self.lambda.iter().map(|&force| force > 0.0).collect();
        let mut flips = 0;
        let mut halved = Halved::new();
        let most = self.tolerance.max_iterations;
        while !self.is_done() && self.outcome.iterations < most && !self.tolerance.is_late() {
            if let Some(set) = &self.set
                && self.merit_of_set(set) <= 1.0
            {
                // Settled for this set, but not the right one.
                self.set = Some(self.next_set(set));
                best = self.place(f64::INFINITY, positions);
                memory.clear();
                halved = Halved { since: self.outcome.iterations, ..Halved::new() };
            }
            if halved.is_late(best.0, self.outcome.iterations) {
                break;
            }
            if !(self.progress() <= growth * best.0) {
                damping *= 0.5;
                if damping < MIN_DAMPING {
                    break;
                }
                self.return_to(&best, positions);
                memory.clear();
            }
            let renewed = self.step_and_pushes(&mut step);
            self.outcome.iterations += 1;
            let push = |i: usize| match &self.set {
                Some(set) => set[i],
                None => renewed[i] > 0.0,
            };
            if (0..pushing.len()).any(|i| pushing[i] != push(i)) {
                memory.clear();
                flips += 1;
                (0..pushing.len()).for_each(|i| pushing[i] = push(i));
            }
            memory.mix(&mut step, damping);
            self.take(&step, &pushing, positions);
            if self.set.is_none() && flips > FLIPS {
                // Some point comes in and goes out again and again.
                self.set = Some(pushing.clone());
                best.0 = f64::INFINITY;
                halved = Halved { since: self.outcome.iterations, ..Halved::new() };
            }
            if self.progress() < best.0 {
                best = self.place(self.progress(), positions);
            }
        }
        let is_settled = self.set.take().is_some();
        if self.merit() <= 1.0 {
            return true;
        }
        if self.tolerance.is_late() {
            if !(self.merit() <= best.0) {
                self.return_to(&best, positions);
            }
        } else {
            let is_closer = !is_settled && best.0 <= CLOSER * start.0;
            self.return_to(if is_closer { &best } else { start }, positions);
        }
        false
    }

    /// Converged, and by an iteration of its own where something pushes: a start that was carried
    /// on from the last solve, and only just good enough, would be carried on again.
    fn is_done(&self) -> bool {
        let is_touched = self.lambda.iter().any(|&force| force > 0.0);
        self.merit() <= 1.0 && (self.outcome.iterations > 0 || !is_touched)
    }

    /// What an iteration is to make smaller.
    fn progress(&self) -> f64 {
        self.set.as_ref().map_or_else(|| self.merit(), |set| self.merit_of_set(set))
    }

    /// How far from converged with the points of `set` at their obstacles and no other pushed.
    fn merit_of_set(&self, set: &[bool]) -> f64 {
        let off = self.gaps.iter().zip(set).filter(|(_, is_in)| **is_in).map(|(gap, _)| gap.abs());
        self.merit_with(off)
    }

    /// Without those that are pulled, with those that are too deep.
    fn next_set(&self, set: &[bool]) -> Vec<bool> {
        (0..set.len())
            .map(|i| match set[i] {
                true => self.lambda[i] > 0.0,
                false => self.gaps[i] < -self.contact.depth,
            })
            .collect()
    }

    /// Ĉ(r + Gᵀ(λ' − λ)), and behind it (λ' − λ) W_ii, which is in m too. Returns λ'.
    fn step_and_pushes(&mut self, step: &mut [f64]) -> Vec<f64> {
        let (n, k) = (self.residual.len(), self.lambda.len());
        let (moves, pushes) = step.split_at_mut(n);
        let renewed = self.plain_step(moves);
        for i in 0..k {
            pushes[i] = (renewed[i] - self.lambda[i]) * self.compliance[(k + 1) * i];
        }
        renewed
    }

    /// Takes a mixed step; what does not push stays so.
    fn take(&mut self, step: &[f64], pushing: &[bool], positions: &mut Field) {
        let (n, k) = (self.residual.len(), self.lambda.len());
        self.problem.advance(positions, &step[..n], 1.0);
        for i in 0..k {
            let give = self.compliance[(k + 1) * i];
            let change = if give > 0.0 { step[n + i] / give } else { 0.0 };
            self.lambda[i] = match (pushing[i], &self.set) {
                (false, _) => 0.0,
                (true, Some(_)) => self.lambda[i] + change,
                (true, None) => (self.lambda[i] + change).max(0.0),
            };
        }
        self.evaluate(positions);
    }
}

/// When what is left last became half of what it was.
struct Halved {
    since: usize,
    left: f64,
}

impl Halved {
    fn new() -> Self {
        Self { since: 0, left: f64::INFINITY }
    }

    /// Whether `left` after so many iterations has long been more than half of what it was.
    fn is_late(&mut self, left: f64, iterations: usize) -> bool {
        if left <= 0.5 * self.left {
            *self = Self { since: iterations, left };
        }
        iterations - self.since >= PATIENCE
    }
}
