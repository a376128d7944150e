//! `validate`: cases with a known solution, and how the error falls under refinement.
//!
//! `study.rs` runs all cases; `beams.rs`, `spheres.rs` and `corotated.rs` hold them,
//! `paper_failure.rs` says where the paper's forces fail.

mod beams;
mod corotated;
mod paper_failure;
mod row;
mod solve;
mod spheres;
mod study;

pub use row::Row;
pub use study::{Report, run};
