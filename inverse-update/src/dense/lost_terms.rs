//! What an update leaves of what it takes away, where it makes C much softer.

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::change::NetChange;
use crate::matrix::SparseStiffness;

/// N − (K + P Pᵀ − N Nᵀ) X, with P and N on the ring's rows.
pub(crate) fn residual(
    k: &SparseStiffness,
    rows: &[usize],
    change: &NetChange,
    x: MatRef<'_, f64>,
) -> Result<Mat<f64>, InverseError> {
    let mut residual = Mat::zeros(x.nrows(), x.ncols());
    let mut image = vec![0.0; x.nrows()];
    for j in 0..x.ncols() {
        let source: Vec<f64> = x.col(j).iter().copied().collect();
        k.apply(&source, &mut image)?;
        residual.col_mut(j).iter_mut().zip(&image).for_each(|(r, value)| *r = -value);
    }
    let at = at_rows(x, rows);
    let (p, n) = (change.u.subcols(0, change.gained), change.lost());
    let own = n.to_owned() - p * (p.transpose() * &at) + n * (n.transpose() * &at);
    for (i, &row) in rows.iter().enumerate() {
        for j in 0..x.ncols() {
            residual[(row, j)] += own[(i, j)];
        }
    }
    Ok(residual)
}

/// Some rows.
pub(crate) fn at_rows(x: MatRef<'_, f64>, rows: &[usize]) -> Mat<f64> {
    Mat::from_fn(rows.len(), x.ncols(), |i, j| x[(rows[i], j)])
}
