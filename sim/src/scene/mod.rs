//! What a scene file says, and whether it makes sense.
//!
//! `description` is the file to open first: [`Scene`] and its tables, data only; `stage_names`,
//! `tool` and `adapter` hold the larger of them. [`file`](mod@file) reads TOML with overrides,
//! `schema` refuses unknown and missing keys with the line they stand in, `checks` refuses values
//! out of range.

mod adapter;
pub(crate) mod checks;
mod description;
pub mod file;
mod key_path;
mod nearest;
mod overrides;
mod region;
mod schema;
mod stage_names;
mod tool;

pub use adapter::Adapter;
pub use description::{
    BesideTissue, Budget, Dynamics, Image, MassModel, MaterialEntry, MeshOptions, Output, Phantom,
    Refinement, Scene, Solver, Support, SupportHold, SurfaceEntry, Time, Void,
};
pub use region::Region;
pub use stage_names::StageNames;
pub use tool::{
    GrabEntry, GrabHold, Key, Normal, PressureEntry, PressureKey, ProbeEntry, ToolEntry,
};

pub(crate) use stage_names::{AUTO, ON_DEVICE};
