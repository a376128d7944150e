//! Equilibrium in the way of obstacles: they push, and never pull.
//!
//! `obstacle.rs` is the stage [`Obstacle`] with a ball; `surface_contact.rs` says which points may
//! touch what; `solve.rs` is the way in. `run.rs` keeps a solve under way, which `together.rs`
//! iterates with positions and contact forces in one; `gauss_seidel.rs` finds forces that push where
//! there is contact; `pushes.rs` has obstacles push with springs, which a solver goes down in energy
//! against where that iteration does not end. Open `solve.rs` first.

mod gauss_seidel;
mod obstacle;
mod pushes;
mod run;
mod solve;
mod surface_contact;
mod together;

pub use obstacle::{Obstacle, Sphere};
pub use pushes::Pushes;
pub use solve::solve_with_contact;
pub use surface_contact::{Contact, ContactOutcome};
