//! What a simulation reports: a row per step, frames, fields, surfaces and the summary.
//!
//! `records` is the file to open first: the types that leave the simulation. `capture`, `fields`,
//! `surfaces` and `comparison_points` take them from a body, `recorder` keeps what these need and
//! adds up a run, `kept` is what it has so far on disk.

mod capture;
mod comparison_points;
mod energy;
mod failure;
mod fields;
mod kept;
mod made_by;
mod opened;
#[cfg(feature = "view")]
mod outer_faces;
mod recorder;
mod records;
mod surfaces;
mod tool;

pub use crate::body::{
    BodySummary, DomainSummary, ImageSummary, LabelRefinementSummary, LabelVoxels, MaterialVoxels,
    Part, TopologySummary,
};
pub use comparison_points::Probe;
pub use energy::{EnergyChange, EnergySummary};
pub use fields::Fields;
pub use made_by::MadeBy;
pub use records::{
    EstimateSummary, Failure, ForceSummary, Frame, GoalReport, InverseSummary, MeshSummary,
    Momentum, Percentiles, PlanRow, Range, StageTimes, StepReport, StepSummary, Summary,
    SurfaceFrame, SurfaceSummary,
};
pub use tool::{ToolReport, ToolSummary};

pub(crate) use failure::Missed;
pub(crate) use kept::{KeptStatistics, Names};
#[cfg(feature = "view")]
pub(crate) use outer_faces::outer_faces;
pub(crate) use recorder::{Recorder, RunStatistics, StepOutcome};
pub(crate) use records::{WARNING, milliseconds};
#[cfg(feature = "view")]
pub(crate) use surfaces::Carried;
pub(crate) use surfaces::{BodyOutline, Surfaces};
pub(crate) use tool::Edited;
