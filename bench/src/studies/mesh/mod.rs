//! `mesh`: shapes, closures, the cost of a split, and what a volume costs to take in.
//!
//! `study.rs` runs it; `updates.rs` and `volumes.rs` measure its two larger parts.

mod study;
mod updates;
mod volumes;

pub use study::run;
