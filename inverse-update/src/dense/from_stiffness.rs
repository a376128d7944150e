//! The inverse from the stiffness alone: how every dense maintainer starts, and rebuilds.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};

use crate::InverseError;
use crate::matrix::SparseStiffness;

const WHAT: &str = "the stiffness";

/// C = K⁻¹ by Cholesky, or by L D Lᵀ without pivoting if K is quasi-definite; lower triangle
/// valid. Cost: O(n³).
/// # Errors
/// [`InverseError::Singular`] if K is not positive definite to working precision, or not
/// quasi-definite as announced.
/// # Source
/// Gill, Saunders, Shinnerl, On the stability of Cholesky factorization for symmetric quasidefinite
/// systems, SIAM J. Matrix Anal. Appl. 17(1), 1996.
pub(crate) fn symmetric_inverse(k: &SparseStiffness) -> Result<Mat<f64>, InverseError> {
    let inverse = if k.negative() == 0 { cholesky(k)? } else { signed(k)? };
    check_condition(k, |i| inverse[(i, i)])?;
    Ok(inverse)
}

/// C = K⁻¹ by LU with partial pivoting; K is checked on the way to be positive definite, or
/// quasi-definite as announced.
/// # Errors
/// As [`symmetric_inverse`].
pub(crate) fn lu_inverse(k: &SparseStiffness) -> Result<Mat<f64>, InverseError> {
    // LU inverts an indefinite matrix without a word; all maintainers refuse the same matrices.
    symmetric_inverse(k)?;
    let inverse = k.to_dense().partial_piv_lu().inverse();
    check_condition(k, |i| inverse[(i, i)])?;
    Ok(inverse)
}

fn cholesky(k: &SparseStiffness) -> Result<Mat<f64>, InverseError> {
    let factor = k.to_dense().llt(Side::Lower).map_err(|error| {
        let faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index: row } = error;
        InverseError::Singular { what: WHAT, row, value: 0.0, limit: limit(k) }
    })?;
    Ok(factor.inverse())
}

/// A quasi-definite matrix has an L D Lᵀ in any order, with the signs of its diagonal in D.
fn signed(k: &SparseStiffness) -> Result<Mat<f64>, InverseError> {
    let floor = |row| limit(k) * k.diagonal(row).abs();
    let singular =
        |row, value| InverseError::Singular { what: WHAT, row, value, limit: floor(row) };
    let factor = k.to_dense().ldlt(Side::Lower).map_err(|error| {
        let faer::linalg::cholesky::ldlt::factor::LdltError::ZeroPivot { index } = error;
        singular(index, 0.0)
    })?;
    let pivots = factor.D().column_vector();
    for row in 0..k.dofs() {
        let value = k.sign(row) * pivots[row];
        // Not `value <= floor(row)`: a NaN has to fail as well.
        if !(value > floor(row) && value.is_finite()) {
            return Err(singular(row, value));
        }
    }
    Ok(factor.inverse())
}

/// Refuses an inverse whose rows are lost in rounding.
///
/// 1/(K_jj C_jj) is the last pivot of the diagonally scaled K if j is eliminated last, and at
/// most n times its smallest eigenvalue; Cholesky can't tell a pivot below n·ε from 0. Only
/// the diagonal is needed: in a positive definite C it bounds the rest.
fn check_condition(
    k: &SparseStiffness,
    inverse_diagonal: impl Fn(usize) -> f64,
) -> Result<(), InverseError> {
    let limit = limit(k);
    for j in 0..k.dofs() {
        let value = 1.0 / (k.diagonal(j) * inverse_diagonal(j));
        // Not `value <= limit`: faer hands NaN on without an error.
        if !(value > limit && value.is_finite()) {
            return Err(InverseError::Singular { what: WHAT, row: j, value, limit });
        }
    }
    Ok(())
}

/// The reciprocal condition below which Cholesky of n rows can't tell a pivot from 0.
fn limit(k: &SparseStiffness) -> f64 {
    k.dofs() as f64 * f64::EPSILON
}
