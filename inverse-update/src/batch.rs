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

impl SparseStiffness {
    /// Makes one update.
    ///
    /// # Errors
    /// Those of [`split`](Self::split), [`merge`](Self::merge) and [`change`](Self::change).
    pub fn update(&mut self, update: &Update) -> Result<(), InverseError> {
        match update {
            Update::Split(change) => self.split(change).map(drop),
            Update::Merge { slot, change } => self.merge(*slot, change).map(drop),
            Update::Change(change) => self.change(change),
        }
    }
}

/// A batch as one update after the other, for maintainers that gain nothing by it.
pub(crate) fn one_by_one<M: InverseMaintainer + ?Sized>(
    maintainer: &mut M,
    updates: &[Update],
) -> Result<(), InverseError> {
    for (done, update) in updates.iter().enumerate() {
        let made = match update {
            Update::Split(change) => maintainer.split(change).map(drop),
            Update::Merge { slot, change } => maintainer.merge(*slot, change).map(drop),
            Update::Change(change) => maintainer.change(change),
        };
        made.map_err(|source| InverseError::in_batch(done, source))?;
    }
    Ok(())
}
