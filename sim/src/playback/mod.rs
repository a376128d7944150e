//! A finished run, read back from its directory.
//!
//! [`Run`] in `run` is where to start: it opens a run directory and gives its frames as they were
//! written. `frame` reads the files of one, `description` the scene, `tool_place` says where tools were.

mod description;
mod frame;
mod run;
mod tool_place;

pub use run::Run;
pub(crate) use run::surfaces;
