//! How far a kept inverse has drifted from the matrix.

use faer::{Mat, MatRef};

use super::residual::residual;
use crate::InverseError;
use crate::matrix::SparseStiffness;

/// The drift above which [`watch`](crate::InverseMaintainer::watch) has an inverse kept in f64
/// rebuilt.
pub const DRIFT_LIMIT: f64 = 1e-8;

/// The same for one kept in f32, whose solutions are refined.
pub const DRIFT_LIMIT_F32: f64 = 1e-2;

/// Loads by which [`watch`](crate::InverseMaintainer::watch) looks at all rows: where what two
/// columns of C are off by cancels under one, it does not under the other.
const WATCHED: usize = 2;

/// Rounding that a fresh inverse may leave in a row of K u, in units of ε (|K| |u| + |f|).
const ROUNDED: f64 = 1024.0;

/// By how much a row of K u = f is missed at most, u = C f as `apply` gives it, for loads of ½ to 1 and
/// either sign in units of √|K_ii|; 0 for what may be rounding, infinite where anything is not finite.
/// Fails as `apply` does.
pub(crate) fn watched_drift(
    k: &SparseStiffness,
    seed: u64,
    apply: impl FnOnce(MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>,
) -> Result<f64, InverseError> {
    let (n, mut state) = (k.dofs(), seed);
    if n == 0 {
        return Ok(0.0);
    }
    let unit: Vec<f64> = (0..n).map(|i| k.diagonal(i).abs().sqrt()).collect();
    let loads = Mat::from_fn(n, WATCHED, |i, _| {
        let bits = random(&mut state);
        let size = 0.5 + (bits >> 12) as f64 * f64::EPSILON / 2.0;
        unit[i] * if bits & 1 == 0 { size } else { -size }
    });
    let solutions = apply(loads.as_ref())?;
    let (mut product, mut rounding, mut worst) = (vec![0.0; n], vec![0.0; n], 0.0_f64);
    for (load, u) in (0..WATCHED).map(|j| (loads.col_as_slice(j), solutions.col_as_slice(j))) {
        if k.apply(u, &mut product).is_err() {
            return Ok(f64::INFINITY);
        }
        k.apply_absolute(u, &mut rounding);
        for i in 0..n {
            let left = (load[i] - product[i]).abs();
            let allowed = ROUNDED * f64::EPSILON * (rounding[i] + load[i].abs());
            // An infinite row, or a NaN, is no rounding.
            if !(left <= allowed) || !left.is_finite() {
                let missed = left / unit[i];
                worst = if missed.is_finite() { worst.max(missed) } else { f64::INFINITY };
            }
        }
    }
    Ok(worst)
}

/// The largest drift of some random columns, which `columns` gives by row number; infinite where
/// anything is not finite. Fails as `columns` does.
pub(crate) fn drift_of_columns(
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
