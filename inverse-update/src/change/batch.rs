//! Content, the third kind of change; and one update of any kind.

use std::ops::Range;

use faer::Mat;

use super::ring_change::RingChange;
use crate::InverseError;
use crate::matrix::{SparseStiffness, check_matrix, check_slots};

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

/// One update, as the method of [`InverseMaintainer`](crate::InverseMaintainer) for its kind takes
/// it.
#[derive(Debug, Clone)]
pub enum Update {
    /// A vertex is added, in the last slot.
    Split(RingChange),
    /// The vertex at `slot` is removed, and the last one moves there.
    Merge {
        /// The vertex to remove.
        slot: usize,
        /// The split that it undoes.
        change: RingChange,
    },
    /// K changes on the vertices that there are.
    Content(StiffnessChange),
}

impl Update {
    pub(crate) fn borrowed(&self) -> UpdateRef<'_> {
        match self {
            Self::Split(change) => UpdateRef::Split(change),
            Self::Merge { slot, change } => UpdateRef::Merge(*slot, change),
            Self::Content(change) => UpdateRef::Content(change),
        }
    }
}

/// An [`Update`] by reference.
#[derive(Clone, Copy)]
pub enum UpdateRef<'a> {
    /// See [`Update::Split`].
    Split(&'a RingChange),
    /// See [`Update::Merge`]: the slot, and the split that is undone.
    Merge(usize, &'a RingChange),
    /// See [`Update::Content`].
    Content(&'a StiffnessChange),
}

impl<'a> UpdateRef<'a> {
    /// The vertices concerned, without the one that is added or removed.
    pub(crate) fn slots(self) -> &'a [usize] {
        match self {
            Self::Split(change) | Self::Merge(_, change) => &change.slots,
            Self::Content(change) => &change.slots,
        }
    }

    /// The slot of the vertex that is removed.
    pub(crate) fn removed(self) -> Option<usize> {
        if let Self::Merge(slot, _) = self { Some(slot) } else { None }
    }

    /// The rows of the vertex that is removed.
    pub(crate) fn removed_rows(self, k: &SparseStiffness) -> Range<usize> {
        self.removed().map_or(0..0, |slot| k.block() * slot..k.block() * (slot + 1))
    }

    /// A bound on the columns of the net change and of the rows that are added.
    pub(crate) fn most_columns(self, block: usize) -> usize {
        match self {
            Self::Split(change) | Self::Merge(_, change) => {
                change.positive.ncols() + change.negative.ncols() + 2 * block
            }
            Self::Content(change) => change.added.ncols() + change.removed.ncols(),
        }
    }
}
