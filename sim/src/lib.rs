//! Interactive simulation of inhomogeneous soft objects: scenes, plan, time loop, tools, output.
#![forbid(unsafe_code)]

mod error;
pub mod indicator;
mod tools;
mod tally;
mod stages;
mod solve;
mod simulation;
mod setup;
mod refinement;
mod plan;
mod inverse_link;
mod frame;
pub mod output;
pub mod report;
pub mod scene;
mod scene_check;
pub mod scene_file;

pub use error::SimError;
pub use inverse_link::InverseFactory;
pub use simulation::Simulation;
pub use stages::Stages;
