//! Cholesky factors of the small matrices that decide whether an update is possible, signed where
//! they are quasi-definite.

use faer::prelude::IntoConst;
use faer::{Mat, MatRef, Scale};

use crate::InverseError;

/// Smallest pivot, relative to the terms that it is the difference of, at which a small
/// Cholesky factor is trusted.
///
/// A pivot this small has lost half of its digits; a rebuild from K loses none.
pub(crate) const PIVOT_FLOOR: f64 = 1.5e-8;

/// G = L Σ Lᵀ for a small symmetric G, Σ diagonal: 1, and −1 in the last `negative` rows.
pub(crate) struct Capacitance {
    lower: Mat<f64>,
    negative: usize,
}

impl Capacitance {
    /// Factors a matrix that was assembled, not subtracted, with `negative` negative rows at the end:
    /// pivots are compared with its own diagonal, to rounding.
    pub(crate) fn of(
        what: &'static str,
        g: MatRef<'_, f64>,
        negative: usize,
    ) -> Result<Self, InverseError> {
        let floor = (g.nrows() + 1) as f64 * f64::EPSILON;
        let limits: Vec<f64> = (0..g.nrows()).map(|i| floor * g[(i, i)].abs()).collect();
        Self::factor(what, g, &limits, negative)
    }

    /// Factors G = P − Q where `scale` is the diagonal of the larger of P and Q.
    pub(crate) fn of_difference(
        what: &'static str,
        g: MatRef<'_, f64>,
        scale: &[f64],
    ) -> Result<Self, InverseError> {
        let limits: Vec<f64> = scale.iter().map(|scale| PIVOT_FLOOR * scale.abs()).collect();
        Self::factor(what, g, &limits, 0)
    }

    /// Factors a G with `negative` rows at the end, where a pivot has to exceed its limit in size.
    ///
    /// Reads the lower triangle of G alone.
    pub(crate) fn factor(
        what: &'static str,
        g: MatRef<'_, f64>,
        limits: &[f64],
        negative: usize,
    ) -> Result<Self, InverseError> {
        let n = g.nrows();
        let sign = |j: usize| if j + negative < n { 1.0 } else { -1.0 };
        let mut lower = Mat::<f64>::zeros(n, n);
        for j in 0..n {
            let mut pivot = g[(j, j)];
            for k in 0..j {
                pivot -= sign(k) * lower[(j, k)] * lower[(j, k)];
            }
            let limit = limits[j];
            // Not `pivot <= limit`: a NaN has to fail as well.
            if !(sign(j) * pivot > limit && pivot.is_finite()) {
                return Err(InverseError::Singular { what, row: j, value: pivot, limit });
            }
            let diagonal = pivot.abs().sqrt();
            lower[(j, j)] = diagonal;
            for i in j + 1..n {
                let mut value = g[(i, j)];
                for k in 0..j {
                    value -= sign(k) * lower[(i, k)] * lower[(j, k)];
                }
                lower[(i, j)] = sign(j) * value / diagonal;
            }
        }
        Ok(Self { lower, negative })
    }

    /// The diagonal of Σ.
    pub(crate) fn sign(&self, j: usize) -> f64 {
        if j + self.negative < self.lower.nrows() { 1.0 } else { -1.0 }
    }

    /// Y Σ Yᵀ for a Y with as many columns as G. Cost: O(n² k).
    pub(crate) fn signed_square(&self, y: MatRef<'_, f64>) -> Mat<f64> {
        if self.negative == 0 {
            return y * y.transpose();
        }
        let signed = Mat::from_fn(y.nrows(), y.ncols(), |i, j| self.sign(j) * y[(i, j)]);
        signed * y.transpose()
    }

    /// Y = Z L⁻ᵀ, so that Z G⁻¹ Zᵀ = Y Σ Yᵀ: rows of Z as many as wanted. Cost: O(n k²).
    pub(crate) fn half_solve(&self, z: MatRef<'_, f64>) -> Mat<f64> {
        let mut y = z.to_owned();
        for column in 0..y.ncols() {
            let (done, rest) = y.as_mut().split_at_col_mut(column);
            let done = done.into_const();
            let mut target = rest.col_mut(0);
            for earlier in 0..column {
                let factor = self.lower[(column, earlier)];
                target -= Scale(factor) * done.col(earlier);
            }
            target /= Scale(self.lower[(column, column)]);
        }
        y
    }

    /// X = Z G⁻¹ for a Z with as many columns as G. Cost: O(n k²).
    pub(crate) fn solve(&self, z: MatRef<'_, f64>) -> Mat<f64> {
        let mut x = self.half_solve(z);
        for j in x.ncols() - self.negative..x.ncols() {
            x.col_mut(j).iter_mut().for_each(|entry| *entry = -*entry);
        }
        // X L = Y Σ, from the last column back.
        for column in (0..x.ncols()).rev() {
            for later in column + 1..x.ncols() {
                let factor = self.lower[(later, column)];
                for i in 0..x.nrows() {
                    x[(i, column)] -= factor * x[(i, later)];
                }
            }
            let diagonal = self.lower[(column, column)];
            for i in 0..x.nrows() {
                x[(i, column)] /= diagonal;
            }
        }
        x
    }

    /// The smallest |pivot| of the negative rows, infinite without any.
    pub(crate) fn smallest_negative(&self) -> f64 {
        let n = self.lower.nrows();
        let pivots = (n - self.negative..n).map(|i| self.lower[(i, i)].powi(2));
        pivots.fold(f64::INFINITY, f64::min)
    }

    /// L, lower triangular.
    pub(crate) fn lower(&self) -> MatRef<'_, f64> {
        self.lower.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;

    #[test]
    fn a_two_by_two_factor_is_the_one_by_hand() {
        // [4, 2; 2, 5] = [2, 0; 1, 2] [2, 1; 0, 2]
        let g = mat![[4.0, 2.0], [2.0, 5.0]];
        let factor = Capacitance::of("g", g.as_ref(), 0).unwrap();
        assert_eq!(factor.lower(), mat![[2.0, 0.0], [1.0, 2.0]]);
        // (6, 9) [4, 2; 2, 5]⁻¹ = (6, 9) [5, −2; −2, 4] / 16 = (12, 24) / 16
        let z = mat![[6.0, 9.0]];
        assert_eq!(factor.solve(z.as_ref()), mat![[0.75, 1.5]]);
        assert_eq!(factor.half_solve(z.as_ref()), mat![[3.0, 3.0]]);
    }

    #[test]
    fn a_quasi_definite_factor_is_the_one_by_hand() {
        // [4, 2; 2, −8] = [2, 0; 1, 3] diag(1, −1) [2, 1; 0, 3]
        let g = mat![[4.0, 2.0], [2.0, -8.0]];
        let factor = Capacitance::of("g", g.as_ref(), 1).unwrap();
        assert_eq!(factor.lower(), mat![[2.0, 0.0], [1.0, 3.0]]);
        // (36, 0) G⁻¹ = (36, 0) [8, 2; 2, −4] / 36 = (8, 2)
        let z = mat![[36.0, 0.0]];
        assert_eq!(factor.solve(z.as_ref()), mat![[8.0, 2.0]]);
        let half = factor.half_solve(z.as_ref());
        assert_eq!(factor.signed_square(half.as_ref()), mat![[36.0 * 8.0]]);
        assert!(Capacitance::of("g", g.as_ref(), 0).is_err(), "not positive definite");
        let definite = mat![[4.0, 2.0], [2.0, 5.0]];
        assert!(Capacitance::of("g", definite.as_ref(), 1).is_err(), "a wrong sign");
    }

    #[test]
    fn singular_indefinite_and_nan_are_refused() {
        let singular = mat![[1.0, 1.0], [1.0, 1.0]];
        let indefinite = mat![[1.0, 2.0], [2.0, 1.0]];
        let nan = mat![[1.0, 0.0], [f64::NAN, 1.0]];
        for g in [singular, indefinite, nan, mat![[f64::INFINITY]], mat![[0.0]]] {
            let error = Capacitance::of("g", g.as_ref(), 0).err().unwrap();
            assert!(matches!(error, InverseError::Singular { what: "g", .. }), "{error}");
        }
    }

    #[test]
    fn a_pivot_that_lost_half_its_digits_is_refused() {
        let g = mat![[1e-9]];
        assert!(Capacitance::of("g", g.as_ref(), 0).is_ok());
        assert!(Capacitance::of_difference("g", g.as_ref(), &[1.0]).is_err());
        assert!(Capacitance::of_difference("g", g.as_ref(), &[1e-3]).is_ok());
    }
}
