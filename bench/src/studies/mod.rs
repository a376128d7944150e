//! The studies, each in a file or folder of its own, by its name on the command line.
//!
//! A study's `run` writes its files and returns what is printed. Bad arguments and a folder that is
//! in use are refused before anything is measured, and nothing is written then.
//!
//! Start with `elements.rs`: it measures its rows and hands them to
//! [`harness::report::write`](crate::harness::report::write), as all others do. `race` is shared by
//! `table1` and `scaling`, `sweep` by `stiff` and `extremes`.

pub mod ablation;
pub mod compare;
pub mod cracks;
pub mod cut;
pub mod drift;
pub mod elements;
pub mod endurance;
pub mod estimates;
pub mod homogenisation;
pub mod identify;
pub mod laws;
pub mod mesh;
pub mod meshes;
pub mod pareto;
mod race;
pub mod reality;
pub mod resolution;
pub mod robust;
pub mod scaling;
pub mod sweep;
pub mod table1;
pub mod touch;
pub mod validate;

pub use crate::harness::arguments::Common;
pub use crate::harness::cases::CaseArguments;
pub use race::Arguments;
