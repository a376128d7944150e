//! The native part of the Python package `yawara`: what `python/yawara` makes pleasant to use.
//!
//! Arrays are C-contiguous and of f64 unless said otherwise. Positions are in scanner axes (right, anterior,
//! superior), m. Long work lets other threads of Python run. `simulation` is the file to open first; `stages` and `tool`
//! call stages that are written in Python, `raised` keeps what these raise.

mod arrays;
mod command;
mod error;
mod forest;
mod identify;
mod inverse;
mod raised;
mod simulation;
mod stages;
mod tool;
mod volume;

/// The extension module.
#[pyo3::pymodule]
mod _yawara {
    #[pymodule_export]
    use crate::command::run_command;
    #[pymodule_export]
    use crate::error::Error;
    #[pymodule_export]
    use crate::forest::BisectionForest;
    #[pymodule_export]
    use crate::identify::{feel, identify};
    #[pymodule_export]
    use crate::inverse::Inverse;
    #[pymodule_export]
    use crate::simulation::{Simulation, materials, scenes};
}
