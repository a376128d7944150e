//! The inverse from the stiffness alone: where every maintainer starts, and starts again.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};

use crate::{InverseError, SparseStiffness};

/// C = K⁻¹ by Cholesky, lower triangle valid. Cost: O(n³).
///
/// # Errors
/// [`InverseError::Singular`] if K is not positive definite to working precision.
pub(crate) fn cholesky_inverse(k: &SparseStiffness) -> Result<Mat<f64>, InverseError> {
    let what = "the stiffness";
    let dense = k.to_dense();
    let factor = dense.llt(Side::Lower).map_err(|error| {
        let faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index: row } = error;
        InverseError::Singular { what, row, value: 0.0, limit: limit(k) }
    })?;
    let inverse = factor.inverse();
    check_condition(what, k, |i| inverse[(i, i)])?;
    Ok(inverse)
}

/// C = K⁻¹ by LU with partial pivoting; K is checked on the way to be positive definite, or
/// quasi-definite as announced.
///
/// # Errors
/// As [`cholesky_inverse`].
pub(crate) fn lu_inverse(k: &SparseStiffness) -> Result<Mat<f64>, InverseError> {
    // LU inverts an indefinite matrix without a word; all maintainers refuse the same matrices.
    if k.negative() == 0 {
        cholesky_inverse(k)?;
    } else {
        check_pivots(k)?;
    }
    let inverse = k.to_dense().partial_piv_lu().inverse();
    check_condition("the stiffness", k, |i| inverse[(i, i)])?;
    Ok(inverse)
}

/// Refuses an inverse whose rows are lost in rounding.
///
/// 1/(K_jj C_jj) is the last pivot of the diagonally scaled K if j is eliminated last, and at
/// most n times its smallest eigenvalue; Cholesky can't tell a pivot below n·ε from 0. Only
/// the diagonal is needed: in a positive definite C it bounds the rest.
fn check_condition(
    what: &'static str,
    k: &SparseStiffness,
    inverse_diagonal: impl Fn(usize) -> f64,
) -> Result<(), InverseError> {
    let limit = limit(k);
    for j in 0..k.dofs() {
        let value = 1.0 / (k.diagonal(j) * inverse_diagonal(j));
        // Not `value <= limit`: faer hands NaN on without an error.
        if !(value > limit && value.is_finite()) {
            return Err(InverseError::Singular { what, row: j, value, limit });
        }
    }
    Ok(())
}

/// Refuses a matrix whose LDLᵀ in the order of its rows has a pivot of the wrong sign.
fn check_pivots(k: &SparseStiffness) -> Result<(), InverseError> {
    let (what, n) = ("the stiffness", k.dofs());
    let mut rest = k.to_dense();
    for j in 0..n {
        let sign = if j % k.block() + k.negative() < k.block() { 1.0 } else { -1.0 };
        let (value, limit) = (rest[(j, j)], limit(k) * k.diagonal(j).abs());
        // Not `value <= limit`: a NaN has to fail as well.
        if !(sign * value > limit && value.is_finite()) {
            return Err(InverseError::Singular { what, row: j, value, limit });
        }
        for c in j + 1..n {
            let factor = rest[(c, j)] / value;
            for i in c..n {
                rest[(i, c)] -= factor * rest[(i, j)];
            }
        }
    }
    Ok(())
}

/// The reciprocal condition below which Cholesky of n rows can't tell a pivot from 0.
fn limit(k: &SparseStiffness) -> f64 {
    k.dofs() as f64 * f64::EPSILON
}
