//! `anderson`: a fixed-at iteration with the warped inverse, accelerated by mixing.

use std::collections::VecDeque;

use super::iteration::Iteration;
use super::problem::Problem;
use super::solver::Equilibrium;
use crate::vectors::{axpy, dot};

/// x ← x + T C Tᵀ(f_ext − f_int(x)) with Anderson mixing over the last `depth` iterates: the
/// combination of past steps whose preconditioned residual is least.
///
/// Source: Walker and Ni, SIAM J. Numer. Anal. 49(4), 2011; the preconditioner T C Tᵀ is the
/// warped inverse of Oishi et al., eq. (2). A residual that grows beyond `growth` × the best
/// returns to the best iterate with half the step and an empty memory.
#[derive(Clone, Debug)]
pub struct Anderson {
    /// Iterates mixed.
    pub depth: usize,
    /// How far the residual may grow above the best before a restart.
    pub growth: f64,
}

impl Default for Anderson {
    fn default() -> Self {
        Self { depth: 8, growth: 20.0 }
    }
}

/// Columns whose part orthogonal to the newer ones is shorter than this fraction are dropped.
const DEPENDENT: f64 = 1e-10;

/// The shortest damped step tried before giving up.
pub(crate) const MIN_DAMPING: f64 = 1.0 / 64.0;

impl Equilibrium for Anderson {
    fn name(&self) -> &'static str {
        "anderson"
    }

    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        let (mut scratch, mut step) = (vec![0.0; problem.rows()], vec![0.0; problem.rows()]);
        let mut memory = Memory::new(self.depth);
        let mut damping = 1.0;
        while point.goes_on() && point.is_on_its_way() {
            if !point.is_within(self.growth) {
                damping *= 0.5;
                if damping < MIN_DAMPING {
                    break;
                }
                point.return_to_best(problem);
                memory.clear();
            }
            problem.precondition(&point.residual, &mut scratch, &mut step);
            point.begin_iteration();
            memory.mix(&mut step, damping);
            point.advance(problem, &step, 1.0);
            point.keep_if_best(problem);
        }
    }
}

/// Differences of successive steps f_k and of the iterates, newest first.
pub(crate) struct Memory {
    depth: usize,
    /// (Δf, Δx) pairs.
    pairs: VecDeque<(Vec<f64>, Vec<f64>)>,
    last: Option<(Vec<f64>, Vec<f64>)>,
}

impl Memory {
    pub fn new(depth: usize) -> Self {
        Self { depth, pairs: VecDeque::with_capacity(depth + 1), last: None }
    }

    pub fn clear(&mut self) {
        self.pairs.clear();
        self.last = None;
    }

    /// Replaces the plain step f by the mixed one, f − (ΔX + ΔF)γ with γ = argmin ‖f − ΔF γ‖.
    pub fn mix(&mut self, step: &mut [f64], damping: f64) {
        let f = step.to_vec();
        if let Some((last_f, last_dx)) = self.last.take() {
            let df = f.iter().zip(&last_f).map(|(a, b)| a - b).collect();
            self.pairs.push_front((df, last_dx));
            self.pairs.truncate(self.depth);
        }
        let gamma = self.least_squares(&f);
        for value in step.iter_mut() {
            *value *= damping;
        }
        for (g, (df, dx)) in gamma.iter().zip(&self.pairs) {
            axpy(-g, dx, step);
            axpy(-g * damping, df, step);
        }
        self.last = Some((f, step.to_vec()));
    }

    /// γ by modified Gram-Schmidt, newest column first; nearly dependent (older) ones get 0.
    fn least_squares(&self, f: &[f64]) -> Vec<f64> {
        let mut q: Vec<Vec<f64>> = Vec::new();
        let mut r: Vec<Vec<f64>> = Vec::new();
        let mut kept = Vec::new();
        for (j, (df, _)) in self.pairs.iter().enumerate() {
            let mut column = df.clone();
            let original = dot(df, df).sqrt();
            let mut entries = Vec::with_capacity(q.len() + 1);
            for base in &q {
                let h = dot(base, &column);
                axpy(-h, base, &mut column);
                entries.push(h);
            }
            let length = dot(&column, &column).sqrt();
            if length <= DEPENDENT * original || length == 0.0 {
                continue;
            }
            column.iter_mut().for_each(|v| *v /= length);
            entries.push(length);
            q.push(column);
            r.push(entries);
            kept.push(j);
        }
        let mut rest = f.to_vec();
        let mut rhs = Vec::with_capacity(q.len());
        for base in &q {
            let h = dot(base, &rest);
            axpy(-h, base, &mut rest);
            rhs.push(h);
        }
        let mut gamma = vec![0.0; self.pairs.len()];
        for j in (0..q.len()).rev() {
            let known: f64 = (j + 1..q.len()).map(|k| r[k][j] * gamma[kept[k]]).sum();
            gamma[kept[j]] = (rhs[j] - known) / r[j][j];
        }
        gamma
    }
}
