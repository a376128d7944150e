//! `lu`: the slow, obvious reference: K is inverted from scratch after every change.

use faer::{Mat, MatRef};

use super::from_stiffness::lu_inverse;
use super::full_storage::Full;
use crate::InverseError;
use crate::InverseMaintainer;
use crate::change::{Update, UpdateRef};
use crate::maintained::{Maintained, Method};
use crate::matrix::{FreshRows, SparseStiffness};

/// Keeps K and its inverse by LU with partial pivoting, computed anew after every change.
///
/// Nothing accumulates, so the others are measured against it. Rebuilding is its ordinary work and
/// not counted. Cost: O(n³) per change, O(n²) per solve, n² numbers.
pub type Lu = Maintained<LuMethod>;

/// See [`Lu`].
#[derive(Default)]
pub struct LuMethod(Full);

impl Method for LuMethod {
    fn name(&self) -> &'static str {
        "lu"
    }

    fn holds_columns(&self) -> bool {
        false
    }

    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError> {
        self.0 = Full(lu_inverse(k)?);
        Ok(())
    }

    fn update(&mut self, k: &SparseStiffness, update: UpdateRef<'_>) -> Result<(), InverseError> {
        let mut k = k.clone();
        k.apply_update(update);
        self.invert(&k)
    }

    fn multiply(&self, _: &SparseStiffness, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        Ok(self.0.multiply(x))
    }

    fn columns(&self, _: &SparseStiffness, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        Ok(self.0.columns(rows))
    }

    fn batch_to(
        whole: &mut Maintained<Self>,
        updates: &[Update],
        rows: &FreshRows,
    ) -> Result<(), InverseError> {
        whole.batch(updates)?;
        whole.refresh(rows)?;
        whole.rebuild()
    }
}
