//! K in units that make its diagonal 1, in which errors are measured.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};

/// K scaled to a unit diagonal: the scale √|K_ii| and the condition number.
pub(super) struct Scaled {
    pub(super) scale: Vec<f64>,
    pub(super) condition: f64,
    /// The norm of the scaled inverse.
    pub(super) compliance: f64,
    /// How much larger than K's entries those of D in K = L D Lᵀ can be, in any order; 1 where K is
    /// definite.
    pub(super) growth: f64,
}

impl Scaled {
    pub(super) fn of(k: &Mat<f64>, negative: usize) -> Self {
        let scale: Vec<f64> = (0..k.nrows()).map(|i| k[(i, i)].abs().sqrt()).collect();
        if scale.is_empty() {
            return Self { scale, condition: 1.0, compliance: 1.0, growth: 1.0 };
        }
        let unit = Mat::from_fn(k.nrows(), k.ncols(), |i, j| k[(i, j)] / (scale[i] * scale[j]));
        let eigenvalues = eigenvalues(&unit);
        let below = eigenvalues.iter().filter(|&&value| value < 0.0).count();
        assert_eq!(below, negative, "the model must have its announced inertia");
        let norm = eigenvalues.iter().map(|value| value.abs()).fold(1.0, f64::max);
        let least = eigenvalues.iter().map(|value| value.abs()).fold(f64::INFINITY, f64::min);
        let condition = norm / least;
        assert!(condition.is_finite(), "the model must not be singular");
        Self { scale, condition, compliance: 1.0 / least, growth: growth(&unit) }
    }

    /// ‖S c S‖ in the Frobenius norm.
    pub(super) fn norm(&self, c: &Mat<f64>) -> f64 {
        let weight = |i: usize, j: usize| self.scale[i] * self.scale[j];
        Mat::from_fn(c.nrows(), c.ncols(), |i, j| weight(i, j) * c[(i, j)]).norm_l2()
    }

    /// ‖S (a − b) S‖ / ‖S b S‖.
    pub(super) fn inverse_error(&self, a: &Mat<f64>, b: &Mat<f64>) -> f64 {
        if self.scale.is_empty() { 0.0 } else { self.norm(&(a - b)) / self.norm(b) }
    }
}

fn eigenvalues(symmetric: &Mat<f64>) -> Vec<f64> {
    symmetric.self_adjoint_eigenvalues(Side::Lower).expect("finite entries")
}

/// For [A, Bᵀ; B, −P], rows in any order, the larger of ‖A + Bᵀ P⁻¹ B‖/‖A‖ and the same with A and
/// P exchanged: the Schur complements of all eliminations lie below these.
///
/// Gill, Saunders, Shinnerl, On the stability of Cholesky factorization for symmetric
/// quasidefinite systems, SIAM J. Matrix Anal. Appl. 17(1), 1996.
fn growth(unit: &Mat<f64>) -> f64 {
    let (first, last): (Vec<usize>, Vec<usize>) =
        (0..unit.nrows()).partition(|&i| unit[(i, i)] > 0.0);
    if first.is_empty() || last.is_empty() {
        return 1.0;
    }
    let of = |x: &[usize], y: &[usize]| Mat::from_fn(x.len(), y.len(), |i, j| unit[(x[i], y[j])]);
    let norm = |m: &Mat<f64>| eigenvalues(m).into_iter().fold(0.0, |most, v| v.abs().max(most));
    let ratio = |rows: &[usize], others: &[usize]| {
        let (own, b) = (of(rows, rows), of(others, rows));
        let inverse = of(others, others).partial_piv_lu().inverse();
        norm(&(&own - b.transpose() * inverse * &b)) / norm(&own)
    };
    ratio(&first, &last).max(ratio(&last, &first)).max(1.0)
}
