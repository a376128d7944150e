//! Errors of the crates as exceptions, with the same words.

use std::fmt::Display;

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::{PyErr, create_exception};
use yawara::SimError;

create_exception!(
    yawara,
    Error,
    PyValueError,
    "A scene, a value or a matrix that was refused, and why."
);

/// The exception of a simulation's error; that of a file is an `OSError`.
pub fn of_simulation(error: SimError) -> PyErr {
    match error {
        SimError::Io(..) => PyOSError::new_err(error.to_string()),
        other => refused(other),
    }
}

/// The exception of any other error.
pub fn refused(error: impl Display) -> PyErr {
    Error::new_err(error.to_string())
}
