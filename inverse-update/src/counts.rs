//! What a maintainer had to do beyond its ordinary updates.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Safeguards that took effect since the maintainer was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Times that it started afresh from K by itself, for whichever reason.
    pub rebuilds: usize,
    /// Those of them that the drift monitor asked for.
    pub drift_rebuilds: usize,
    /// Updates whose small factor failed: a pivot lost, or of the wrong sign.
    pub failed_pivots: usize,
    /// Corrections of a solution by its residual, one per right-hand side and step.
    pub refinement_steps: usize,
}

/// [`Counts`] under way: solutions are counted behind a shared reference.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    rebuilds: AtomicUsize,
    drift_rebuilds: usize,
    failed_pivots: usize,
    refinement_steps: AtomicUsize,
}

impl Tally {
    pub(crate) fn counts(&self) -> Counts {
        Counts {
            rebuilds: self.rebuilds.load(Ordering::Relaxed),
            drift_rebuilds: self.drift_rebuilds,
            failed_pivots: self.failed_pivots,
            refinement_steps: self.refinement_steps.load(Ordering::Relaxed),
        }
    }

    pub(crate) fn refined(&self, steps: usize) {
        self.refinement_steps.fetch_add(steps, Ordering::Relaxed);
    }

    pub(crate) fn rebuilt(&self) {
        self.rebuilds.fetch_add(1, Ordering::Relaxed);
    }

    /// A rebuild since an update's small factor failed.
    pub(crate) fn rebuilt_for_pivot(&mut self) {
        self.rebuilt();
        self.failed_pivots += 1;
    }

    /// A rebuild since the inverse had drifted.
    pub(crate) fn rebuilt_for_drift(&mut self) {
        self.rebuilt();
        self.drift_rebuilds += 1;
    }
}
