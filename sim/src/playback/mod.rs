//! A finished run, read back from its directory.
//!
//! [`Run`] in `run` is where to start: it opens a run directory and gives its frames as they were
//! written. `frame` reads the files of one, `description` the scene, `tool_place` says where tools were, `gltf`
//! writes it for other programs.

mod colours;
mod description;
mod frame;
mod gltf;
mod run;
mod tool_place;

pub use gltf::write_gltf;
pub use run::Run;

pub(crate) use colours::COLOURS;
pub(crate) use run::surfaces;

use std::path::Path;

use crate::SimError;

/// What is wrong with a file of a run.
fn wrong(path: &Path, reason: &str) -> SimError {
    SimError::Syntax { place: path.display().to_string(), reason: reason.into() }
}
