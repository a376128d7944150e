//! The third kind of change: content. The vertices stay, their stiffness changes.

use faer::Mat;

use crate::InverseError;
use crate::matrix::{check_matrix, check_slots};

/// A change of content, on vertices that stay: ΔK = A Aᵀ − B Bᵀ with A `added`, B `removed`.
///
/// Made by: a material edit and an element removed or put back (its K in factors); a split or merge
/// whose midpoint is fixed (its condensed change). A cut that doubles a vertex is such a change, by
/// which elements leave the vertex, after [`RingChange::freed`](crate::RingChange::freed) has added
/// the copy that they move to.
///
/// The positive part is applied first, so that K stays positive definite on the way.
/// Units: (N/m)^½. Rows are vertex-major in the order of `slots`.
#[derive(Debug, Clone)]
pub struct StiffnessChange {
    /// The vertices concerned.
    pub slots: Vec<usize>,
    /// Factor of what is added, r × p; p may be 0.
    pub added: Mat<f64>,
    /// Factor of what is removed, r × q; q may be 0.
    pub removed: Mat<f64>,
}

impl StiffnessChange {
    /// Checks shapes, finiteness and slots.
    ///
    /// # Errors
    /// [`InverseError`]: the first defect found, by name, place, value and limit.
    pub fn check(&self, vertices: usize, block: usize) -> Result<(), InverseError> {
        check_slots(&self.slots, vertices)?;
        let r = block * self.slots.len();
        check_matrix("added", self.added.as_ref(), (r, self.added.ncols()))?;
        check_matrix("removed", self.removed.as_ref(), (r, self.removed.ncols()))
    }

    /// ΔK = A Aᵀ − B Bᵀ, r × r.
    #[must_use]
    pub fn delta(&self) -> Mat<f64> {
        &self.added * self.added.transpose() - &self.removed * self.removed.transpose()
    }
}
