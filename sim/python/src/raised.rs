//! What a stage that is written in Python raises, kept until the work that called it is over.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;

/// The first exception of any stage of a simulation.
#[derive(Clone, Default)]
pub struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Calls Python; what that raises is kept, and `none` stands in its place.
    pub fn call<T>(&self, none: T, call: impl FnOnce(Python<'_>) -> PyResult<T>) -> T {
        Python::attach(|py| {
            call(py).unwrap_or_else(|error| {
                self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                none
            })
        })
    }

    /// Raises what was kept, now and whenever it is asked again: what was computed since is worth nothing.
    pub fn check(&self, py: Python<'_>) -> PyResult<()> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.as_ref().map_or(Ok(()), |error| Err(error.clone_ref(py)))
    }
}
