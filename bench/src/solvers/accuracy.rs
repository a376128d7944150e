//! The error that goes with a time.

use faer::Mat;
use yawara_inverse_update::InverseMaintainer;

use crate::error::BenchError;

/// ‖C − C_ref‖_F / ‖C_ref‖_F of a maintained inverse C against a fresh one, `reference`.
///
/// The reference is itself rounded: about ε · cond(K) is the least that can be seen. Infinite if
/// the shapes differ or anything is not finite. Cost: O(n²).
///
/// # Errors
/// [`BenchError::Inverse`] if the maintainer refuses to hand out its columns.
pub fn inverse_error(
    maintainer: &dyn InverseMaintainer,
    reference: &Mat<f64>,
) -> Result<f64, BenchError> {
    let slots: Vec<usize> = (0..maintainer.vertices()).collect();
    let kept = maintainer.columns(&slots)?;
    if (kept.nrows(), kept.ncols()) != (reference.nrows(), reference.ncols()) {
        return Ok(f64::INFINITY);
    }
    let error = (&kept - reference).norm_l2() / reference.norm_l2();
    Ok(if error.is_finite() { error } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara_inverse_update::{SparseStiffness, build};

    #[test]
    fn the_error_is_the_relative_frobenius_distance() {
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        k.add(&[0, 1], Mat::from_fn(2, 2, |i, j| if i == j { 0.5 } else { 0.0 }).as_ref()).unwrap();
        let c = build("woodbury", k).unwrap();
        // C = 2 I. The reference differs by (3, 0; 0, 4): 5 / √(5² + 6²).
        let reference = Mat::from_fn(2, 2, |i, j| if i == j { 5.0 + i as f64 } else { 0.0 });
        let error = inverse_error(c.as_ref(), &reference).unwrap();
        assert!((error - 5.0 / 61f64.sqrt()).abs() < 1e-15);
        let nan = Mat::from_fn(2, 2, |_, _| f64::NAN);
        assert_eq!(inverse_error(c.as_ref(), &nan).unwrap(), f64::INFINITY);
        assert_eq!(inverse_error(c.as_ref(), &Mat::zeros(3, 3)).unwrap(), f64::INFINITY);
    }
}
