//! What the loops of device and solver share.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use nalgebra::Vector3;

use super::coupling::ForceModel;

/// What the solver tells the device's loop.
#[derive(Clone, Copy)]
pub(super) struct Snapshot {
    pub model: ForceModel,
    /// When the tool was asked to go there.
    pub asked: Instant,
}

/// What the two loops share; each side holds the lock for a copy alone.
pub(super) struct Shared {
    pub snapshot: Mutex<Snapshot>,
    /// Where the tool is to go next, m, and when that was said.
    pub target: Mutex<(Vector3<f64>, Instant)>,
    pub ended: AtomicBool,
}

/// The lock, whatever happened to the thread that held it before.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
