//! The small algebra of a symmetric low-rank update: from the ring's rows of C U to the terms that
//! one pass adds to C.

use std::ops::Range;

use faer::{Mat, MatRef, Side};

use super::precision::Precision;
use crate::InverseError;
use crate::change::{Capacitance, NetChange};
use crate::matrix::SparseStiffness;

/// (Λ + UᵀCU)⁻¹ = A Σ Aᵀ, so that C becomes C − (C U A) Σ (C U A)ᵀ.
pub(crate) struct SignedRoot {
    /// A, k × k.
    pub(crate) root: Mat<f64>,
    /// The diagonal of Σ.
    pub(crate) signs: Vec<f64>,
    /// The smallest pivot of what is lost, 1 if nothing is: its inverse is how much C grows.
    pub(crate) softening: f64,
}

impl SignedRoot {
    /// For a K with `negative` rows of negative pivots per vertex.
    ///
    /// `product`: C U on the rows of U.
    /// # Errors
    /// [`InverseError::Singular`].
    pub(crate) fn new<E: Precision>(
        change: &NetChange,
        product: MatRef<'_, f64>,
        negative: usize,
    ) -> Result<Self, InverseError> {
        match negative {
            0 => Self::definite::<E>(change, product),
            _ => Self::quasi_definite::<E>(change, product),
        }
    }

    /// For a positive definite K: gained columns first, so that K stays so on the way, and
    /// G = Λ + UᵀCU = L Σ Lᵀ in this order, A = L⁻ᵀ.
    ///
    /// A pivot of I − NᵀC'N is a difference from 1: below the
    /// scalar's `PIVOT_FLOOR` its digits are lost.
    /// # Errors
    /// [`InverseError::Singular`].
    fn definite<E: Precision>(
        change: &NetChange,
        product: MatRef<'_, f64>,
    ) -> Result<Self, InverseError> {
        let g = capacitance(change, product);
        let (p, k) = (change.gained, change.u.ncols());
        let floor = (k + 1) as f64 * E::EPSILON;
        let limits: Vec<f64> =
            (0..k).map(|j| if j < p { floor * g[(j, j)].abs() } else { E::PIVOT_FLOOR }).collect();
        let factor = Capacitance::factor(change.what, g.as_ref(), &limits, k - p)?;
        Ok(Self {
            root: factor.half_solve(Mat::<f64>::identity(k, k).as_ref()),
            signs: (0..k).map(|j| factor.sign(j)).collect(),
            softening: factor.smallest_negative().min(1.0),
        })
    }

    /// For a quasi-definite K, whose inertia an update keeps if and only if G has the inertia of Λ:
    /// G = S V D Vᵀ S by eigenvectors, S its diagonal's scale, A = S⁻¹ V |D|^(−½).
    /// # Errors
    /// [`InverseError::Singular`] if an eigenvalue of the scaled G is below the scalar's
    /// `PIVOT_FLOOR`, or there are more or fewer negative ones than columns lost.
    /// # Source
    /// Haynsworth, Determination of the inertia of a partitioned Hermitian matrix, Linear Algebra
    /// Appl. 1, 1968.
    fn quasi_definite<E: Precision>(
        change: &NetChange,
        product: MatRef<'_, f64>,
    ) -> Result<Self, InverseError> {
        let what = change.what;
        let failed =
            |row, value| InverseError::Singular { what, row, value, limit: E::PIVOT_FLOOR };
        let g = capacitance(change, product);
        let k = g.nrows();
        if k == 0 {
            return Ok(Self { root: Mat::zeros(0, 0), signs: Vec::new(), softening: 1.0 });
        }
        if let Some(row) = (0..k).find(|&i| !(0..k).all(|j| g[(i, j)].is_finite())) {
            return Err(failed(row, f64::NAN));
        }
        let scale: Vec<f64> = (0..k).map(|j| g[(j, j)].abs().max(1.0).sqrt()).collect();
        let scaled =
            Mat::from_fn(k, k, |i, j| (0.5 * g[(i, j)] + 0.5 * g[(j, i)]) / (scale[i] * scale[j]));
        let eigen = scaled.self_adjoint_eigen(Side::Lower).map_err(|_| failed(0, f64::NAN))?;
        let values: Vec<f64> = eigen.S().column_vector().iter().copied().collect();
        let mut negative = 0;
        for (row, &value) in values.iter().enumerate() {
            if !(value.abs() > E::PIVOT_FLOOR) {
                return Err(failed(row, value));
            }
            negative += usize::from(value < 0.0);
        }
        if negative != k - change.gained {
            return Err(failed(negative, values[negative.min(k - 1)]));
        }
        let vectors = eigen.U();
        Ok(Self {
            root: Mat::from_fn(k, k, |i, j| vectors[(i, j)] / (scale[i] * values[j].abs().sqrt())),
            signs: values.iter().map(|value| value.signum()).collect(),
            softening: 1.0,
        })
    }
}

/// G = Λ + UᵀCU.
fn capacitance(change: &NetChange, product: MatRef<'_, f64>) -> Mat<f64> {
    let mut g = change.u.transpose() * product;
    for j in 0..g.nrows() {
        g[(j, j)] += if j < change.gained { 1.0 } else { -1.0 };
    }
    g
}

/// Checks the diagonal of an updated inverse. A finite diagonal of the right signs shows that the
/// terms are finite, and bounds a positive definite C; anything else is a failed update. Rows about
/// to be removed are exempt: without their ring they may have any sign in a quasi-definite C.
/// # Errors
/// [`InverseError::Singular`].
pub(crate) fn check_diagonal(
    k: &SparseStiffness,
    diagonal: impl IntoIterator<Item = f64>,
    removed: &Range<usize>,
) -> Result<(), InverseError> {
    for (row, value) in diagonal.into_iter().enumerate() {
        let is_right = k.sign(row) * value > 0.0 && value.is_finite();
        if !is_right && !removed.contains(&row) {
            let what = "the diagonal of the inverse";
            return Err(InverseError::Singular { what, row, value, limit: 0.0 });
        }
    }
    Ok(())
}

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
