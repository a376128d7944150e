//! `compare A B`: two results of a study, figure by figure.
//!
//! `study.rs` compares; `result.rs` reads any study's result.

mod result;
mod study;

pub use study::{Arguments, Change, Comparison, compare};
