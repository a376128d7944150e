//! One step of the simulation, and the loop over all of them.
//!
//! `simulation` is the file to open first: it owns the parts and runs them in order. `equilibrium`
//! brings the body to rest under its loads, starting from what `predictor` expects, with inertia by
//! `dynamics` and probes by `contact`; `refinement` splits and merges where the
//! [`indicator`] asks for it; `tool_forces` measures what tools feel.

mod contact;
mod dynamics;
mod equilibrium;
pub mod indicator;
mod predictor;
mod refinement;
mod simulation;
mod tool_forces;

pub use simulation::Simulation;
