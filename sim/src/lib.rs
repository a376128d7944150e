//! Interactive simulation of inhomogeneous soft objects: scenes, plan, time loop, tools, output.
#![forbid(unsafe_code)]

mod body;
mod choice;
mod compliance;
mod error;
pub mod haptic;
mod inverse_link;
pub mod output;
pub mod report;
pub mod scene;
pub mod step;
mod tools;

pub use body::{BodyState, ScannerAxes};
pub use choice::{MIXED_FROM, Stages, choose_element};
pub use error::SimError;
pub use haptic::{ForceModel, VirtualCoupling};
pub use inverse_link::{InverseFactory, InverseLink};
pub use report::{Fields, Probe};
pub use scene::file as scene_file;
pub use step::{Simulation, SimulationBuilder, indicator};
pub use tools::{BodyAtRest, Pose, SurfacePoints, Tool, ToolPath};
