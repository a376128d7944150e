//! Interactive simulation of inhomogeneous soft objects: scenes, plan, time loop, tools, output.
#![forbid(unsafe_code)]

mod body;
mod choice;
mod error;
pub mod haptic;
pub mod inverse;
pub mod output;
pub mod report;
pub mod scene;
mod step;
mod tools;

pub use body::{BodyState, ScannerAxes};
pub use choice::{MIXED_FROM, Stages, choose_element};
pub use error::SimError;
pub use haptic::{ForceModel, VirtualCoupling};
pub use inverse::{InverseFactory, InverseLink};
pub use report::{Fields, Probe};
pub use scene::file as scene_file;
pub use step::{Simulation, SimulationBuilder, indicator};
pub use tools::{BodyAtRest, Pose, SurfacePoints, Tool, ToolPath};
