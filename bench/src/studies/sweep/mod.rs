//! Scenes at the edge of what is reasonable: the studies `stiff` and `extremes`.
//!
//! `study.rs` measures a list of points, each against its own converged reference; `stiff.rs` and
//! `extremes.rs` make the lists.

pub mod extremes;
pub mod stiff;
mod study;
