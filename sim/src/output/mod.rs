//! What a run leaves on disk: a run directory, written aside and moved into place when whole.
//!
//! `run_directory` is the file to open first. `partial` are the names of those in the making, `checkpoint` what one is
//! gone on with from, `interrupted` takes it up.

mod atomic_file;
mod checkpoint;
mod fields;
mod interrupted;
#[cfg(feature = "gmsh")]
mod msh;
mod partial;
mod resolved;
mod resume_error;
mod run_directory;
mod steps_csv;
#[cfg(feature = "view")]
mod steps_table;
mod vtu;

pub(crate) use atomic_file::{write_file, write_json};
pub use interrupted::Interrupted;
#[cfg(feature = "gmsh")]
pub use msh::write_msh;
pub use partial::{Cleaned, clean};
pub use resume_error::ResumeError;
pub use run_directory::RunDirectory;
#[cfg(feature = "view")]
pub(crate) use steps_table::read_steps;
pub use vtu::write_vtu;
