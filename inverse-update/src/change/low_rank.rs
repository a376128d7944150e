//! Symmetric changes of low rank, in factors.

use faer::{Mat, MatRef, Side};

/// Columns of several matrices, on the same rows.
pub(crate) fn beside(parts: &[MatRef<'_, f64>]) -> Mat<f64> {
    let rows = parts.first().map_or(0, |part| part.nrows());
    let mut whole = Mat::zeros(rows, parts.iter().map(|part| part.ncols()).sum());
    let mut first = 0;
    for part in parts {
        whole.subcols_mut(first, part.ncols()).copy_from(part);
        first += part.ncols();
    }
    whole
}

/// U Σ Uᵀ = Σ_j ± v_j v_jᵀ by eigenvectors, Σ = diag(`signs`): the columns v_j and the eigenvalues,
/// whose signs are those of the terms, but for those below `floor` of the largest. `is_scaled`: rows
/// of U are brought to equal size first, so that small ones keep their digits.
///
/// Cost: O((r + k) k²) for r rows and k columns.
/// # Errors
/// The largest entry of the small matrix whose eigenvectors don't exist.
pub(crate) fn eigenvectors(
    u: MatRef<'_, f64>,
    signs: &[f64],
    is_scaled: bool,
    floor: f64,
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
    let (values, vectors) = (eigen.S().column_vector(), basis * eigen.U());
    let floor = floor * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let kept: Vec<usize> = (0..values.nrows()).filter(|&j| values[j].abs() > floor).collect();
    let column = |i, j: usize| scale[i] * vectors[(i, kept[j])] * values[kept[j]].abs().sqrt();
    let columns = Mat::from_fn(u.nrows(), kept.len(), column);
    Ok((columns, kept.iter().map(|&j| values[j]).collect()))
}
