//! `drift`: what 10⁴ random splits, merges and changes of material leave of the inverse, and
//! whether its monitor sees it.
//!
//! `study.rs` runs it; `report.rs` has its rows, its claims and its tables.

mod report;
mod study;

pub use study::{Arguments, run};
