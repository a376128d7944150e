//! An edit of the stiffness that leaves all slots where they are, for batches.

use crate::{InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange};

/// One of the edits of a batch, see [`InverseMaintainer::edit_batch`].
#[derive(Debug, Clone, Copy)]
pub enum Edit<'a> {
    /// A vertex comes in, as by [`InverseMaintainer::split`].
    Split(&'a RingChange),
    /// Existing vertices change, as by [`InverseMaintainer::change`].
    Change(&'a StiffnessChange),
}

impl Edit<'_> {
    /// Makes the edit by itself.
    ///
    /// # Errors
    /// As [`InverseMaintainer::split`] and [`InverseMaintainer::change`].
    pub fn make<M: InverseMaintainer + ?Sized>(
        &self,
        maintainer: &mut M,
    ) -> Result<(), InverseError> {
        match self {
            Self::Split(change) => maintainer.split(change).map(drop),
            Self::Change(change) => maintainer.change(change),
        }
    }

    /// The old vertices concerned.
    pub(crate) fn slots(&self) -> &[usize] {
        match self {
            Self::Split(change) => &change.slots,
            Self::Change(change) => &change.slots,
        }
    }

    /// The columns of its net change at most, and of the rows that come in.
    pub(crate) fn most_columns(&self, block: usize) -> usize {
        match self {
            Self::Split(change) => change.positive.ncols() + change.negative.ncols() + 2 * block,
            Self::Change(change) => change.added.ncols() + change.removed.ncols(),
        }
    }

    pub(crate) fn check(&self, k: &SparseStiffness) -> Result<(), InverseError> {
        match self {
            Self::Split(change) => k.check_split(change),
            Self::Change(change) => k.check_change(change),
        }
    }

    /// Changes K, once it is checked.
    pub(crate) fn apply(&self, k: &mut SparseStiffness) {
        match self {
            Self::Split(change) => k.apply_split(change),
            Self::Change(change) => k.apply_change(change),
        }
    }
}
