//! Interactive simulation of inhomogeneous soft objects: scenes, plan, time loop, tools, output.
#![forbid(unsafe_code)]

mod body_report;
mod compliance;
mod coupling;
mod element_choice;
mod error;
mod feedback;
mod fields;
mod fixed_mesh;
mod frame;
pub mod haptic;
mod image_source;
pub mod indicator;
mod inverse_link;
mod label_floor;
mod material_check;
mod motion;
mod motion_check;
pub mod output;
mod parts;
mod plan;
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
mod tool_check;
mod tool_report;
mod tools;
mod touch;

pub use coupling::{ForceModel, VirtualCoupling};
pub use element_choice::{MIXED_FROM, choose_element};
pub use error::SimError;
pub use fields::Fields;
pub use inverse_link::{InverseFactory, InverseLink};
pub use simulation::Simulation;
pub use stages::Stages;
pub use tools::Pose;
