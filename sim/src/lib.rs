//! Interactive simulation of inhomogeneous soft objects: scenes, plan, time loop, tools, output.
//!
//! A [`Scene`](scene::Scene) says what the body is, what acts on it and how long; it comes from a TOML
//! file ([`scene_file`]) or is filled in by hand. [`Stages`] holds one implementation of each stage
//! that can be swapped, and a [`Simulation`] makes steps:
//!
//! ```
//! use yawara::{Simulation, scene_file};
//!
//! fn main() -> Result<(), yawara::SimError> {
//!     let settings = ["time.steps=2".into(), "mesh.max_level=3".into()];
//!     let (scene, _) = scene_file::load("beam", &settings)?;
//!     let mut simulation = Simulation::builder(&scene).build()?;
//!     while simulation.steps_left() > 0 {
//!         let report = simulation.step()?;
//!         println!("{} s: {} vertices, {:?} N", report.time_s, report.vertices, report.force_n);
//!         assert!(report.converged);
//!     }
//!     println!("{} points", simulation.frame()?.points_mm.len());
//!     Ok(())
//! }
//! ```
//!
//! A volume in memory and tools of your own go to the [`SimulationBuilder`]; [`Tool`] and
//! [`Indicator`](indicator::Indicator) show one each.
//!
//! # Terms
//! - *Ring*: the tetrahedra around an edge (its edge star, or edge patch). A split bisects the edge
//!   and with it all tetrahedra of the ring; a merge undoes that.
//! - *Level*: how often the base mesh was bisected; three levels halve the edges.
//! - *Indicator*: the number that a ring has, above which it is split.
//! - *Inverse*: the inverse of the stiffness matrix, kept while splits and merges change it. *Slots*
//!   number its vertices without gaps.
//! - *Solver axes*: those of the image's grid, m. *Scanner axes*: right, anterior, superior (RAS).
#![forbid(unsafe_code)]

mod body;
mod choice;
pub mod cli;
mod error;
pub mod feel;
#[cfg(feature = "view")]
pub mod film;
pub mod haptic;
pub mod identify;
pub mod inverse;
pub mod output;
#[cfg(feature = "view")]
pub mod playback;
pub mod preview;
pub mod report;
pub mod scene;
mod step;
mod tools;
#[cfg(feature = "view")]
pub mod view;

pub use body::{BodyState, ScannerAxes};
pub use choice::{MIXED_FROM, Stages, choose_element};
pub use error::SimError;
pub use haptic::{ForceModel, VirtualCoupling};
pub use inverse::{Elements, InverseFactory, InverseLink};
pub use report::{Fields, Probe};
pub use scene::file as scene_file;
pub use step::{Checkpoint, Simulation, SimulationBuilder, indicator};
pub use tools::{BodyAtRest, Edit, Holding, Pose, SurfacePoints, Tool, ToolPath};
