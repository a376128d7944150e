//! Error against run time: combinations of stages on one scene, against a converged reference.
//!
//! [`Study`] lists [`Candidate`]s, yours among them, and [`Study::run`] measures each in a process
//! that can be interrupted, and writes tables, plots and a report. Start with `study.rs`;
//! `measure.rs` runs one candidate, `converged.rs` makes the reference, `write.rs` the files.

mod body_picture;
mod candidate;
mod choices;
mod converged;
mod deadline;
mod front;
mod measure;
mod path;
mod report;
mod results;
mod scatter;
mod study;
mod write;

pub use candidate::Candidate;
pub use converged::{RESIDUAL, Reference, ReferenceSummary};
pub use front::front;
pub use measure::measure;
pub use path::Path;
pub use results::Results;
pub use study::{Options, Study};
