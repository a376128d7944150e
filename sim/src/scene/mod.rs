//! What a scene file says, and whether it makes sense.
//!
//! `description` is the file to open first: [`Scene`] and its tables, data only; `stage_names`,
//! `region`, `law` and `tool` hold the larger of them. [`file`](mod@file) reads TOML with overrides,
//! `schema` refuses unknown and missing keys with the line they stand in, `checks` refuses values
//! out of range. `library` has materials by name, with their sources; `input_files` are the files that a scene names.

pub(crate) mod checks;
mod description;
pub mod file;
mod input_files;
mod key_path;
mod law;
mod library;
mod overrides;
mod region;
mod schema;
mod stage_names;
mod table_csv;
mod tool;

pub use description::{
    BesideTissue, Budget, Dynamics, GoalEntry, Image, LengthUnit, MassModel, MaterialEntry,
    MeshOptions, NearProbe, Output, Phantom, Refinement, Scene, Solver, Support, SupportHold,
    SurfaceEntry, Time, Void,
};
pub use law::{LawEntry, PowerLaw, PronyEntry, RelaxingPart};
pub use library::{LibraryMaterial, library, library_material_of};
pub use region::Region;
pub use stage_names::{Adapter, StageNames};
pub use tool::{
    AblationEntry, GrabEntry, GrabHold, Key, LoadEntry, LoadKey, Normal, PressureEntry,
    PressureKey, ProbeEntry, ScalpelEntry, ToolEntry,
};

pub(crate) use input_files::{input_files, sha256, sha256_of};
pub(crate) use law::MaterialLaw;
pub(crate) use region::{Shape, Way};
pub(crate) use stage_names::{AUTO, ON_DEVICE};
pub(crate) use table_csv::Table;
pub(crate) use tool::Course;
