//! What a run leaves on disk: a run directory, written aside and moved into place when whole.

mod atomic_file;
mod fields;
#[cfg(feature = "gmsh")]
mod msh;
mod partial;
mod resolved;
mod run_directory;
mod steps_csv;
#[cfg(feature = "view")]
mod steps_table;
mod vtu;

pub(crate) use atomic_file::{write_file, write_json};
#[cfg(feature = "gmsh")]
pub use msh::write_msh;
pub use partial::clean;
pub use run_directory::RunDirectory;
#[cfg(feature = "view")]
pub(crate) use steps_table::read_steps;
pub use vtu::write_vtu;
