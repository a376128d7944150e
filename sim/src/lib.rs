//! Interactive simulation of inhomogeneous soft objects: scenes, plan, time loop, tools, output.
#![forbid(unsafe_code)]

mod body_report;
mod element_choice;
mod error;
mod fields;
mod fixed_mesh;
mod frame;
mod image_source;
pub mod indicator;
mod inverse_link;
mod label_floor;
mod material_check;
pub mod output;
mod parts;
mod plan;
mod probe;
mod refinement;
pub mod report;
pub mod scene;
mod scene_check;
pub mod scene_file;
mod setup;
mod simulation;
mod solve;
mod stages;
mod start;
mod state;
mod surfaces;
mod tally;
mod tools;

pub use element_choice::{MIXED_FROM, choose_element};
pub use error::SimError;
pub use fields::Fields;
pub use inverse_link::{InverseFactory, InverseLink};
pub use probe::Probe;
pub use simulation::Simulation;
pub use stages::Stages;
