//! A symmetric change of low rank, in factors.

use faer::{Mat, MatRef, Side};

/// U Λ Uᵀ on some rows of K: `gained` columns with +1, then `lost` ones with −1.
pub(crate) struct LowRank<'a> {
    pub(crate) what: &'static str,
    pub(crate) gained: MatRef<'a, f64>,
    pub(crate) lost: MatRef<'a, f64>,
}

impl LowRank<'_> {
    pub(crate) fn columns(&self) -> usize {
        self.gained.ncols() + self.lost.ncols()
    }

    /// U, and behind it other columns on the same rows.
    pub(crate) fn beside(&self, more: MatRef<'_, f64>) -> Mat<f64> {
        let (p, k) = (self.gained.ncols(), self.columns());
        Mat::from_fn(self.gained.nrows(), k + more.ncols(), |i, j| match j {
            j if j < p => self.gained[(i, j)],
            j if j < k => self.lost[(i, j - p)],
            j => more[(i, j - k)],
        })
    }
}

/// U Σ Uᵀ = Σ_j ± v_j v_jᵀ by eigenvectors, Σ = diag(`signs`): the columns v_j and the eigenvalues,
/// whose signs are those of the terms. `is_scaled`: rows of U are brought to equal size first, so
/// that small ones keep their digits.
///
/// Cost: O((r + k) k²) for r rows and k columns.
/// # Errors
/// The largest entry of the small matrix whose eigenvectors don't exist.
pub(crate) fn eigenvectors(
    u: MatRef<'_, f64>,
    signs: &[f64],
    is_scaled: bool,
) -> Result<(Mat<f64>, Vec<f64>), f64> {
    let size = |i: usize| match u.row(i).norm_l2() {
        norm if is_scaled && norm > 0.0 => norm,
        _ => 1.0,
    };
    let scale: Vec<f64> = (0..u.nrows()).map(size).collect();
    let qr = Mat::from_fn(u.nrows(), u.ncols(), |i, j| u[(i, j)] / scale[i]).qr();
    let (basis, upper) = (qr.compute_thin_Q(), qr.thin_R());
    let signed = Mat::from_fn(upper.nrows(), u.ncols(), |i, j| signs[j] * upper[(i, j)]);
    let small = signed * upper.transpose();
    let eigen = small.self_adjoint_eigen(Side::Lower).map_err(|_| small.norm_max())?;
    let values: Vec<f64> = eigen.S().column_vector().iter().copied().collect();
    let vectors = basis * eigen.U();
    let column = |i, j: usize| scale[i] * vectors[(i, j)] * values[j].abs().sqrt();
    Ok((Mat::from_fn(u.nrows(), values.len(), column), values))
}
