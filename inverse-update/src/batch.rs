//! Several updates in one call.

use crate::{InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange};

/// One update, as the method of [`InverseMaintainer`] of the same name takes it.
#[derive(Debug, Clone)]
pub enum Update {
    /// A vertex comes in, in the last slot.
    Split(RingChange),
    /// The vertex at `slot` goes out, and the last one moves there.
    Merge {
        /// The vertex that goes.
        slot: usize,
        /// The split that it undoes.
        change: RingChange,
    },
    /// K changes on the vertices that there are.
    Change(StiffnessChange),
}

impl Update {
    /// Makes it by itself.
    ///
    /// # Errors
    /// As the method of [`InverseMaintainer`].
    pub fn make<M: InverseMaintainer + ?Sized>(
        &self,
        maintainer: &mut M,
    ) -> Result<(), InverseError> {
        match self {
            Self::Split(change) => maintainer.split(change).map(drop),
            Self::Merge { slot, change } => maintainer.merge(*slot, change).map(drop),
            Self::Change(change) => maintainer.change(change),
        }
    }

    /// The vertices concerned that stay.
    pub(crate) fn slots(&self) -> &[usize] {
        match self {
            Self::Split(change) | Self::Merge { change, .. } => &change.slots,
            Self::Change(change) => &change.slots,
        }
    }

    /// The columns of the net change at most, and of the rows that come in.
    pub(crate) fn most_columns(&self, block: usize) -> usize {
        match self {
            Self::Split(change) | Self::Merge { change, .. } => {
                change.positive.ncols() + change.negative.ncols() + 2 * block
            }
            Self::Change(change) => change.added.ncols() + change.removed.ncols(),
        }
    }
}

impl SparseStiffness {
    /// Makes one update.
    ///
    /// # Errors
    /// Those of [`split`](Self::split), [`merge`](Self::merge) and [`change`](Self::change).
    pub fn update(&mut self, update: &Update) -> Result<(), InverseError> {
        self.check_update(update)?;
        self.apply_update(update);
        Ok(())
    }

    pub(crate) fn check_update(&self, update: &Update) -> Result<(), InverseError> {
        match update {
            Update::Split(change) => self.check_split(change),
            Update::Merge { slot, change } => self.check_merge(*slot, change),
            Update::Change(change) => self.check_change(change),
        }
    }

    /// Once it is checked.
    pub(crate) fn apply_update(&mut self, update: &Update) {
        match update {
            Update::Split(change) => self.apply_split(change),
            Update::Merge { slot, change } => _ = self.apply_merge(*slot, change),
            Update::Change(change) => self.apply_change(change),
        }
    }
}

/// A batch as one update after the other, for maintainers that gain nothing by it.
pub(crate) fn one_by_one<M: InverseMaintainer + ?Sized>(
    maintainer: &mut M,
    updates: &[Update],
) -> Result<(), InverseError> {
    updates.iter().enumerate().try_for_each(|(done, update)| {
        update.make(maintainer).map_err(|source| InverseError::in_batch(done, source))
    })
}
