//! What a maintainer had to do beyond its ordinary updates.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Safeguards that took effect since the maintainer was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Times that the maintainer rebuilt its inverse from K by itself, for whichever reason.
    pub rebuilds: usize,
    /// Those of them that the drift monitor asked for.
    pub drift_rebuilds: usize,
    /// Updates whose small factor failed: a pivot lost, or of the wrong sign.
    pub failed_pivots: usize,
    /// Corrections of a solution by its residual, one per right-hand side and step.
    pub refinement_steps: usize,
}

/// [`Counts`] being kept: solutions are counted behind a shared reference.
#[derive(Debug, Default)]
pub(crate) struct Tally(Mutex<Counts>);

impl Tally {
    fn lock(&self) -> MutexGuard<'_, Counts> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn counts(&self) -> Counts {
        *self.lock()
    }

    pub(crate) fn refined(&self, steps: usize) {
        self.lock().refinement_steps += steps;
    }

    pub(crate) fn rebuilt(&self) {
        self.lock().rebuilds += 1;
    }

    /// A rebuild since an update's small factor failed.
    pub(crate) fn rebuilt_for_pivot(&self) {
        self.rebuilt();
        self.lock().failed_pivots += 1;
    }

    /// A rebuild since the inverse had drifted.
    pub(crate) fn rebuilt_for_drift(&self) {
        self.rebuilt();
        self.lock().drift_rebuilds += 1;
    }
}
