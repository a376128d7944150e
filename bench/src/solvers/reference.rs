//! Solutions that others are measured against: a fresh factor, refined with exact residuals.

use yawara_inverse_update::SparseStiffness;

use crate::error::{BenchError, Result};
use crate::solvers::direct::{Direct, Solver};

/// Up to so many rows the factor is dense LU, above it is sparse LLᵀ: LU would take longer than
/// all that it is to judge.
const DENSE_ROWS: usize = 3072;

/// Refinement ends when a correction is this small relative to the solution.
const SETTLED: f64 = 1e-14;

/// Corrections tried: each gains the digits that the factor has, at least one.
const CORRECTIONS: usize = 20;

/// K assembled afresh, with a factor of it.
pub(crate) struct Reference {
    k: SparseStiffness,
    method: Direct,
    factor: Solver,
}

impl Reference {
    /// Factors `k`.
    pub fn new(k: SparseStiffness) -> Result<Self> {
        let (method, factor) = if k.dofs() <= DENSE_ROWS {
            (Direct::Lu, Solver::Lu(k.to_dense().partial_piv_lu()))
        } else {
            (Direct::SparseAmd, Direct::SparseAmd.rebuild(&k)?.0)
        };
        Ok(Self { k, method, factor })
    }

    /// Rows of K.
    pub fn rows(&self) -> usize {
        self.k.dofs()
    }

    /// Which factor it is, `lu` or `sparse_refactor_amd`.
    pub fn name(&self) -> &'static str {
        self.method.name()
    }

    /// u = K⁻¹ f, refined with residuals of twice the precision until it does not change any more.
    /// # Source
    /// Demmel et al., Error bounds from extra-precise iterative refinement, ACM TOMS 32(2), 2006.
    pub fn solve(&self, f: &[f64]) -> Result<Vec<f64>> {
        let mut u = vec![0.0; f.len()];
        let mut change = f64::INFINITY;
        for _ in 0..CORRECTIONS {
            let correction = self.factor.solve(&residual(&self.k, f, &u));
            u.iter_mut().zip(&correction).for_each(|(u, c)| *u += c);
            change = norm(&correction) / norm(&u);
            if change <= SETTLED {
                return Ok(u);
            }
        }
        Err(BenchError::Unsettled(f.len(), change, SETTLED))
    }
}

/// ‖a − b‖ / ‖b‖; infinite where it is not finite.
pub(crate) fn relative_error(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let error = norm(&difference) / norm(b);
    if error.is_finite() { error } else { f64::INFINITY }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// f − K u as if computed in twice the precision and then rounded.
/// # Source
/// Ogita, Rump, Oishi, Accurate sum and dot product, SIAM J. Sci. Comput. 26(6), 2005: Dot2.
fn residual(k: &SparseStiffness, f: &[f64], u: &[f64]) -> Vec<f64> {
    let m = k.block();
    let mut residual = Vec::with_capacity(f.len());
    for (row, &start) in f.iter().enumerate() {
        let (slot, a) = (row / m, row % m);
        let (mut sum, mut carry) = (start, 0.0);
        for &other in k.neighbours(slot) {
            let Some(value) = k.block_at(slot, other) else { continue };
            for b in 0..m {
                let (x, y) = (-value[m * a + b], u[m * other + b]);
                let product = x * y;
                let next = sum + product;
                let part = next - sum;
                carry += (sum - (next - part)) + (product - part) + x.mul_add(y, -product);
                sum = next;
            }
        }
        residual.push(sum + carry);
    }
    residual
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;

    #[test]
    fn the_residual_keeps_what_cancels() {
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        let e = 2f64.powi(-30);
        k.add(&[0, 1], Mat::from_fn(2, 2, |i, j| if i == j { 1.0 + e } else { 1.0 }).as_ref())
            .unwrap();
        // (1 + e)² + e² − (1 + 2 e) = 2 e², far below the rounding of (1 + e)².
        let got = residual(&k, &[1.0 + 2.0 * e, 0.0], &[1.0 + e, e * e]);
        assert_eq!(got[0], -2.0 * e * e);
    }

    #[test]
    fn a_solution_is_right_to_the_last_digits_where_the_condition_is_1e9() {
        // A chain with a spring 1e9 times as stiff: u = f/1 + f/1e9 at the end.
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        let (soft, stiff) = (1.0, 1e9);
        let entry = |i: usize, j: usize| match (i, j) {
            (0, 0) => soft + stiff,
            (1, 1) => stiff,
            _ => -stiff,
        };
        k.add(&[0, 1], Mat::from_fn(2, 2, entry).as_ref()).unwrap();
        let u = Reference::new(k).unwrap().solve(&[0.0, 1.0]).unwrap();
        let want = [1.0, 1.0 + 1e-9];
        assert!(relative_error(&u, &want) < 4.0 * f64::EPSILON, "{u:?}");
    }

    #[test]
    fn errors_are_relative_and_never_nan() {
        assert_eq!(relative_error(&[3.0, 4.0], &[0.0, 4.0]), 0.75);
        assert_eq!(relative_error(&[f64::NAN], &[1.0]), f64::INFINITY);
        assert_eq!(relative_error(&[1.0], &[1.0, 2.0]), f64::INFINITY);
    }
}
