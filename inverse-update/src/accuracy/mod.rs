//! How good a kept inverse is: the residual of a solution and the step that reduces it
//! (`residual.rs`, the file to open first), how far the inverse has drifted from K (`drift.rs`),
//! and how often a maintainer had to act on either (`counts.rs`).

mod counts;
mod drift;
mod residual;

pub use counts::Counts;
pub(crate) use counts::Tally;
pub use drift::{DRIFT_LIMIT, DRIFT_LIMIT_F32};
pub(crate) use drift::{WATCHED, is_too_far, kept_drift, worst_drift};
pub use residual::REFINEMENT_LIMIT;
pub(crate) use residual::{exceeds_rounding, refine_each, residual, solve_refined};
