//! Benches of the stages and studies that compare their implementations.
//!
//! Criterion benches (`benches/`) watch one stage each for changes of speed; studies
//! ([`studies`], `yawara-bench STUDY --out DIR`) run competitors side by side, alternating in one
//! process, and write times with the errors that go with them. Both take their bodies from
//! [`Organ`] and their updates of the inverse from [`History`]. A study of your own measures rows and
//! hands them to [`harness::report::write`].
#![forbid(unsafe_code)]

mod bodies;
mod error;
pub mod harness;
pub mod pareto;
#[cfg(feature = "petsc")]
mod petsc;
mod solvers;
pub mod studies;
mod workloads;

pub use bodies::beams::{BEAM_LOADS, Beam, BeamLoad, StepCount, mean_iterations};
pub use bodies::organ::{Organ, Size};
pub use bodies::solid::Solid;
pub use bodies::statics::Statics;
pub use error::{BenchError, Result};
pub use harness::machine::Machine;
pub use harness::statistics::{median, percentile, ratios};
pub use harness::{cases, ranks};
pub use solvers::ReferenceBy;
pub use solvers::accuracy::inverse_error;
pub use solvers::direct::{DIRECT, Direct};
pub use workloads::history::{History, Update};
