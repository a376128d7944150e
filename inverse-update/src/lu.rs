//! `lu`: the slow, obvious reference: after every change K is inverted afresh.

use faer::Mat;

use crate::counts::Tally;
use crate::drift::{DRIFT_LIMIT, is_too_far};
use crate::fresh::lu_inverse;
use crate::{
    Counts, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, full,
};

/// Keeps K and its inverse by LU with partial pivoting, computed anew after every change.
///
/// Nothing accumulates, so the others are measured against it. Starting afresh is its ordinary
/// work and not counted. Cost: O(n³) per change, O(n²) per solve, n² numbers.
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

    fn edit<T>(
        &mut self,
        edit: impl FnOnce(&mut SparseStiffness) -> Result<T, InverseError>,
    ) -> Result<T, InverseError> {
        let mut stiffness = self.stiffness.clone();
        let outcome = edit(&mut stiffness)?;
        self.inverse = lu_inverse(&stiffness)?;
        self.stiffness = stiffness;
        Ok(outcome)
    }

    #[cfg(test)]
    pub(crate) fn spoil(&mut self, fraction: f64) {
        self.inverse
            .get_mut(..3, ..)
            .col_iter_mut()
            .for_each(|mut c| c *= faer::Scale(1.0 + fraction));
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
        full::solve(&self.inverse, &self.stiffness, (f, u), &self.tally)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        full::columns(&self.inverse, slots, self.stiffness.block())
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.inverse = lu_inverse(&self.stiffness)?;
        Ok(())
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        let drift = full::drift(&self.inverse, &self.stiffness, seed);
        if is_too_far(self.name(), drift, DRIFT_LIMIT) {
            self.rebuild()?;
            self.tally.rebuilt_for_drift();
        }
        Ok(drift)
    }

    fn counts(&self) -> Counts {
        self.tally.counts()
    }
}
