//! How far a kept inverse has drifted from the matrix.

use faer::Mat;

use crate::residual::residual;
use crate::{InverseMaintainer, SparseStiffness};

/// The drift above which [`watch`](InverseMaintainer::watch) has an inverse kept in f64 rebuilt.
pub const DRIFT_LIMIT: f64 = 1e-8;

/// The same for one kept in f32, whose solutions are refined.
pub const DRIFT_LIMIT_F32: f64 = 1e-2;

/// Columns that [`watch`](InverseMaintainer::watch) looks at.
pub(crate) const WATCHED: usize = 8;

/// The largest s_j = √|K_jj| ‖D^(−½)(K c_j − e_j)‖ over random columns j, D = |diag K|.
///
/// Dimensionless: independent of units and of the ratio of moduli. Of the columns as
/// [`columns`](InverseMaintainer::columns) delivers them: refined ones where a maintainer refines.
/// Infinite if anything on the way is not finite; 0 without vertices or samples. `seed` picks the
/// columns. Cost: O(samples) columns and products with the sparse K.
#[must_use]
pub fn drift(maintainer: &dyn InverseMaintainer, seed: u64, samples: usize) -> f64 {
    let k = maintainer.stiffness();
    let (mut worst, mut scratch): (f64, _) = (0.0, Scratch::new(k));
    for j in random_rows(k, seed, samples) {
        let Ok(columns) = maintainer.columns(&[j / k.block()]) else { return f64::INFINITY };
        worst = worst.max(scratch.drift_of(k, j, columns.col_as_slice(j % k.block())));
    }
    worst
}

/// The largest drift of some columns as they are kept; `kept` gives them by row number.
pub(crate) fn kept_drift(
    k: &SparseStiffness,
    seed: u64,
    kept: impl FnOnce(&[usize]) -> Mat<f64>,
) -> f64 {
    let rows = random_rows(k, seed, WATCHED);
    let (columns, mut scratch) = (kept(&rows), Scratch::new(k));
    let each =
        rows.iter().zip(0..).map(|(&j, at)| scratch.drift_of(k, j, columns.col_as_slice(at)));
    each.fold(0.0, f64::max)
}

/// Whether that drift asks for a rebuild; says so.
pub(crate) fn is_too_far(method: &'static str, drift: f64, limit: f64) -> bool {
    let too_far = drift > limit;
    if too_far {
        tracing::warn!(drift, limit, "{method}: drifted from the stiffness, rebuilt");
    }
    too_far
}

struct Scratch {
    unit: Vec<f64>,
    residual: Vec<f64>,
}

impl Scratch {
    fn new(k: &SparseStiffness) -> Self {
        Self { unit: vec![0.0; k.dofs()], residual: vec![0.0; k.dofs()] }
    }

    /// s_j, which is the residual of c_j relative to e_j; infinite instead of NaN, which
    /// `f64::max` would hide.
    fn drift_of(&mut self, k: &SparseStiffness, j: usize, column: &[f64]) -> f64 {
        self.unit[j] = 1.0;
        let s = residual(k, &self.unit, column, &mut self.residual);
        self.unit[j] = 0.0;
        if s.is_finite() { s } else { f64::INFINITY }
    }
}

/// None without rows.
fn random_rows(k: &SparseStiffness, seed: u64, samples: usize) -> Vec<usize> {
    let (n, mut state) = (k.dofs() as u64, seed);
    let samples = if n == 0 { 0 } else { samples };
    (0..samples).map(|_| (random(&mut state) % n) as usize).collect()
}

/// SplitMix64 (Steele, Lea, Flood 2014): good enough to pick columns, the same everywhere.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests;
