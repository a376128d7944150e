//! `lu`: the slow, obvious reference: after every change K is inverted afresh.

use faer::Mat;

use crate::fresh::lu_inverse;
use crate::{
    Counts, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, full,
};

/// Keeps K and its inverse by LU with partial pivoting, computed anew after every change.
///
/// Nothing accumulates, so the others are measured against it. Starting afresh is its ordinary
/// work: [`Counts`] stay 0. Cost: O(n³) per change, O(n²) per solve, n² numbers.
pub struct Lu {
    stiffness: SparseStiffness,
    inverse: Mat<f64>,
}

impl Lu {
    /// Inverts `stiffness`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        let inverse = lu_inverse(&stiffness)?;
        Ok(Self { stiffness, inverse })
    }

    fn edit<T>(
        &mut self,
        edit: impl FnOnce(&mut SparseStiffness) -> Result<T, InverseError>,
    ) -> Result<T, InverseError> {
        let mut stiffness = self.stiffness.clone();
        let outcome = edit(&mut stiffness)?;
        *self = Self::new(stiffness)?;
        Ok(outcome)
    }
}

impl InverseMaintainer for Lu {
    fn name(&self) -> &'static str {
        "lu"
    }

    fn vertices(&self) -> usize {
        self.stiffness.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        &self.stiffness
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.edit(|k| k.split(change))
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.edit(|k| k.merge(slot, change))
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.edit(|k| k.change(change))
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        full::multiply(&self.inverse, f, u)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        full::columns(&self.inverse, slots, self.stiffness.block())
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.inverse = lu_inverse(&self.stiffness)?;
        Ok(())
    }

    fn counts(&self) -> Counts {
        Counts::default()
    }
}
