//! `lu`: the slow, obvious reference: K is inverted from scratch after every change.

use faer::Mat;

use super::from_stiffness::lu_inverse;
use super::full_storage;
use crate::InverseError;
use crate::accuracy::{Counts, DRIFT_LIMIT, Tally, is_too_far};
use crate::change::{RingChange, StiffnessChange, UpdateRef};
use crate::maintainer::{InverseMaintainer, maintained};
use crate::matrix::SparseStiffness;

/// Keeps K and its inverse by LU with partial pivoting, computed anew after every change.
///
/// Nothing accumulates, so the others are measured against it. Rebuilding is its ordinary work and
/// not counted. Cost: O(n³) per change, O(n²) per solve, n² numbers.
pub struct Lu {
    stiffness: SparseStiffness,
    inverse: Mat<f64>,
    tally: Tally,
}

impl Lu {
    /// Inverts `stiffness`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        let inverse = lu_inverse(&stiffness)?;
        Ok(Self { stiffness, inverse, tally: Tally::default() })
    }

    fn update(&mut self, update: UpdateRef<'_>) -> Result<(), InverseError> {
        self.stiffness.check(update)?;
        let mut stiffness = self.stiffness.clone();
        stiffness.apply_update(update);
        self.inverse = lu_inverse(&stiffness)?;
        self.stiffness = stiffness;
        Ok(())
    }

    fn kept_drift(&self, seed: u64) -> Result<f64, InverseError> {
        Ok(full_storage::drift(&self.inverse, &self.stiffness, seed))
    }

    #[cfg(test)]
    pub(crate) fn spoil(&mut self, fraction: f64) {
        full_storage::spoil(&mut self.inverse, fraction);
    }
}

impl InverseMaintainer for Lu {
    maintained!(DRIFT_LIMIT);

    fn name(&self) -> &'static str {
        "lu"
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        full_storage::solve(&self.inverse, &self.stiffness, (f, u), &self.tally)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        full_storage::columns(&self.inverse, &self.stiffness, slots)
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.inverse = lu_inverse(&self.stiffness)?;
        Ok(())
    }
}
