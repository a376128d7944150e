//! The program `yawara`.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program `yawara` with these words, its own name first; returns the status that it ends with.
#[pyfunction]
pub fn run_command(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| yawara::cli::run(words))
}
