//! How good a kept inverse is: the residual of a solution (`residual.rs`, the file to open first),
//! the steps that reduce it (`refinement.rs`), and how far the inverse has drifted from K
//! (`drift.rs`).

mod drift;
mod refinement;
mod residual;

pub use drift::{DRIFT_LIMIT, DRIFT_LIMIT_F32};
pub(crate) use drift::{drift_of_columns, is_too_far, random, watched_drift};
pub use refinement::{MOST_REFINEMENTS, REFINED_RESIDUAL, REFINEMENT_LIMIT};
pub(crate) use refinement::{refine_columns, refine_each};
#[cfg(test)]
pub(crate) use residual::residual;
