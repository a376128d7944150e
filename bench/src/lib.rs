//! Benches of the stages and studies that compare their implementations.
//!
//! Criterion benches (`benches/`) watch one stage each for changes of speed; studies
//! ([`studies`], `yawara-bench STUDY --out DIR`) run competitors side by side, alternating in one
//! process, and write times with the errors that go with them. Both take their bodies from
//! [`Organ`] and their updates of the inverse from [`History`].
#![forbid(unsafe_code)]

mod accuracy;
mod beams;
mod block;
pub mod cases;
mod direct;
mod error;
mod history;
mod machine;
mod material_edits;
mod organ;
mod output;
pub mod pareto;
mod picture;
mod plot;
mod progress;
mod random;
pub mod ranks;
mod reference;
mod solid;
mod statics;
mod statistics;
mod stream;
pub mod studies;

pub use accuracy::inverse_error;
pub use beams::{BEAM_LOADS, Beam, BeamLoad, StepCount, mean_iterations};
pub use direct::{DIRECT, Direct};
pub use error::BenchError;
pub use history::{History, Update};
pub use machine::Machine;
pub use material_edits::MaterialEdits;
pub use organ::{Organ, Size};
pub use output::Output;
pub use solid::Solid;
pub use statics::Statics;
pub use statistics::{median, percentile, ratios};
pub use stream::Stream;
