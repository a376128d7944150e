//! How far a kept inverse has drifted from the matrix.

use faer::Mat;

use super::residual::residual;
use crate::InverseError;
use crate::matrix::SparseStiffness;

/// The drift above which [`watch`](crate::InverseMaintainer::watch) has an inverse kept in f64
/// rebuilt.
pub const DRIFT_LIMIT: f64 = 1e-8;

/// The same for one kept in f32, whose solutions are refined.
pub const DRIFT_LIMIT_F32: f64 = 1e-2;

/// Columns that [`watch`](crate::InverseMaintainer::watch) looks at.
pub(crate) const WATCHED: usize = 8;

/// The largest drift of some random columns, which `columns` gives by row number; infinite where
/// anything is not finite. Fails as `columns` does.
pub(crate) fn kept_drift(
    k: &SparseStiffness,
    seed: u64,
    samples: usize,
    columns: impl FnOnce(&[usize]) -> Result<Mat<f64>, InverseError>,
) -> Result<f64, InverseError> {
    let rows = random_rows(k, seed, samples);
    let columns = columns(&rows)?;
    let (mut unit, mut residuals) = (vec![0.0; k.dofs()], vec![0.0; k.dofs()]);
    let mut worst: f64 = 0.0;
    for (at, &j) in rows.iter().enumerate() {
        unit[j] = 1.0;
        let s = residual(k, &unit, columns.col_as_slice(at), &mut residuals);
        unit[j] = 0.0;
        // `f64::max` would hide a NaN.
        worst = if s.is_finite() { worst.max(s) } else { f64::INFINITY };
    }
    Ok(worst)
}

/// Whether a drift calls for a rebuild, and logs it.
pub(crate) fn is_too_far(method: &'static str, drift: f64, limit: f64) -> bool {
    let too_far = drift > limit;
    if too_far {
        tracing::warn!(drift, limit, "{method}: drifted from the stiffness, rebuilt");
    }
    too_far
}

/// Random row numbers, none where there are no rows.
fn random_rows(k: &SparseStiffness, seed: u64, samples: usize) -> Vec<usize> {
    let (n, mut state) = (k.dofs() as u64, seed);
    let samples = if n == 0 { 0 } else { samples };
    (0..samples).map(|_| (random(&mut state) % n) as usize).collect()
}

/// SplitMix64 (Steele, Lea, Flood 2014): good enough to pick columns, the same everywhere.
pub(crate) fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
