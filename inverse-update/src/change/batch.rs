//! One update of three kinds, and sequences of them.

use std::ops::Range;

use super::ring_change::RingChange;
use super::stiffness_change::StiffnessChange;
use crate::matrix::SparseStiffness;

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
