//! The terms of what an update takes away, refined by K where it leaves C much softer.

use faer::{Mat, MatRef};

use super::store::DenseStore;
use crate::InverseError;
use crate::change::{Capacitance, LowRank};
use crate::matrix::SparseStiffness;

/// An update's Y = C_:r W and its signs Σ, and what is known of it on the ring's rows.
pub(crate) struct Terms {
    /// W, r × k.
    pub(crate) w: Mat<f64>,
    /// Σ, so that C becomes C + Y Σ Yᵀ.
    pub(crate) signs: Vec<f64>,
    /// Y_r, r × k.
    pub(crate) at_ring: Mat<f64>,
}

impl Terms {
    /// Σ Yᵀ X for rows of X that Y has, or Σ Wᵀ X.
    pub(crate) fn signed(&self, factor: MatRef<'_, f64>, x: MatRef<'_, f64>) -> Mat<f64> {
        let mut inner = factor.transpose() * x;
        for (k, sign) in self.signs.iter().enumerate() {
            inner.row_mut(k).iter_mut().for_each(|value| *value *= sign);
        }
        inner
    }
}

/// Y of the columns lost, n × q, from C'' N after one step of refinement by K: I + NᵀC''N does not
/// cancel.
///
/// # Errors
/// [`InverseError::Singular`] if that is not positive definite; those of the store.
pub(crate) fn lost_terms<S: DenseStore>(
    store: &mut S,
    k: &SparseStiffness,
    rows: &[usize],
    change: &LowRank<'_>,
    terms: &Terms,
) -> Result<Mat<f64>, InverseError> {
    let lost = change.lost;
    let at = terms.signed(terms.at_ring.as_ref(), lost);
    let mut softened = store.product(rows, (lost + &terms.w * at).as_ref())?;
    let residual = residual(k, rows, change, softened.as_ref())?;
    let step = store.multiply(residual.as_ref())?;
    // Yᵀ R = Wᵀ (C R)_r.
    let inner = terms.signed(terms.w.as_ref(), at_rows(&step, rows).as_ref());
    softened += step;
    softened += store.product(rows, (&terms.w * inner).as_ref())?;
    let q = lost.ncols();
    let g = Mat::<f64>::identity(q, q) + lost.transpose() * at_rows(&softened, rows);
    let root =
        Capacitance::of(change.what, g.as_ref())?.half_solve(Mat::<f64>::identity(q, q).as_ref());
    Ok(softened * root)
}

/// N − (K + P Pᵀ − N Nᵀ) X, with P and N on the ring's rows.
pub(crate) fn residual(
    k: &SparseStiffness,
    rows: &[usize],
    change: &LowRank<'_>,
    x: MatRef<'_, f64>,
) -> Result<Mat<f64>, InverseError> {
    let mut residual = Mat::zeros(x.nrows(), x.ncols());
    let mut image = vec![0.0; x.nrows()];
    for j in 0..x.ncols() {
        let source: Vec<f64> = x.col(j).iter().copied().collect();
        k.apply(&source, &mut image)?;
        residual.col_mut(j).iter_mut().zip(&image).for_each(|(r, value)| *r = -value);
    }
    let at = Mat::from_fn(rows.len(), x.ncols(), |i, j| x[(rows[i], j)]);
    let (p, n) = (change.gained, change.lost);
    let own = n.to_owned() - p * (p.transpose() * &at) + n * (n.transpose() * &at);
    for (i, &row) in rows.iter().enumerate() {
        for j in 0..x.ncols() {
            residual[(row, j)] += own[(i, j)];
        }
    }
    Ok(residual)
}

pub(crate) fn at_rows(x: &Mat<f64>, rows: &[usize]) -> Mat<f64> {
    Mat::from_fn(rows.len(), x.ncols(), |i, j| x[(rows[i], j)])
}
