//! `lbfgs`: quasi-Newton steps on top of the warped inverse, with a line search.

use std::collections::VecDeque;

use super::iteration::Iteration;
use super::line_search::search;
use super::problem::Problem;
use super::solver::Equilibrium;
use crate::vectors::{axpy, dot};

/// L-BFGS over the last `depth` steps, its first matrix the warped inverse T C Tᵀ of the current
/// rotations; each step by a line search on the force along it.
///
/// It goes downhill in energy, so that it does not leave the branch of solutions that it starts
/// on, where mixing may. With an anisotropic D the forces are no exact gradient and it can stall
/// near 10⁻⁵. Cost: one solve and mostly one force evaluation an iteration, O(depth · n) besides.
/// Source: Nocedal, Math. Comp. 35(151), 1980; Liu, Bouaziz, Kavan, Quasi-Newton methods for
/// real-time simulation of hyperelastic materials, ACM TOG 36(3), 2017 (its first matrix constant).
#[derive(Clone, Debug)]
pub struct Lbfgs {
    /// Steps remembered.
    pub depth: usize,
}

impl Default for Lbfgs {
    fn default() -> Self {
        Self { depth: 8 }
    }
}

/// What a step may leave of the slope along it.
const CURVATURE: f64 = 0.9;

/// Pairs whose curvature sᵀy is below this fraction of ‖s‖‖y‖ are forgotten.
const FLAT: f64 = 1e-10;

impl Equilibrium for Lbfgs {
    fn name(&self) -> &'static str {
        "lbfgs"
    }

    fn needs_definite(&self) -> bool {
        true
    }

    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        if problem.body.is_mixed() {
            return;
        }
        let n = problem.rows();
        let (mut direction, mut scratch, mut before) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut memory = Pairs { depth: self.depth, pairs: VecDeque::new() };
        while point.goes_on() && point.is_on_its_way() {
            memory.direction(problem, &point.residual, &mut scratch, &mut direction);
            point.begin_iteration();
            before.copy_from_slice(&point.residual);
            let length = search(problem, point, &direction, CURVATURE);
            if length == 0.0 {
                if memory.pairs.is_empty() {
                    break;
                }
                memory.pairs.clear();
                continue;
            }
            memory.push(&direction, length, &before, &point.residual);
            point.keep_if_best(problem);
        }
    }
}

/// A step s and the change y of the force that it made, with 1/sᵀy.
struct Pair {
    s: Vec<f64>,
    y: Vec<f64>,
    rho: f64,
}

/// Newest first.
struct Pairs {
    depth: usize,
    pairs: VecDeque<Pair>,
}

impl Pairs {
    /// direction = H residual by the two loops, H₀ = T C Tᵀ.
    fn direction(
        &self,
        problem: &Problem<'_>,
        residual: &[f64],
        scratch: &mut [f64],
        direction: &mut [f64],
    ) {
        let mut q = residual.to_vec();
        let mut weights = Vec::with_capacity(self.pairs.len());
        for Pair { s, y, rho } in &self.pairs {
            let weight = rho * dot(s, &q);
            axpy(-weight, y, &mut q);
            weights.push(weight);
        }
        problem.precondition(&q, scratch, direction);
        for (Pair { s, y, rho }, weight) in self.pairs.iter().zip(weights).rev() {
            let correction = weight - rho * dot(y, direction);
            axpy(correction, s, direction);
        }
    }

    fn push(&mut self, direction: &[f64], length: f64, before: &[f64], after: &[f64]) {
        let s: Vec<f64> = direction.iter().map(|d| length * d).collect();
        let y: Vec<f64> = before.iter().zip(after).map(|(b, a)| b - a).collect();
        let curvature = dot(&s, &y);
        if curvature > FLAT * dot(&s, &s).sqrt() * dot(&y, &y).sqrt() {
            self.pairs.push_front(Pair { s, y, rho: 1.0 / curvature });
            self.pairs.truncate(self.depth);
        }
    }
}
