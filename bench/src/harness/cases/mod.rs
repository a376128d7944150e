//! Studies of cases that are run one by one and kept one by one.
//!
//! A [`Case`] makes a [`Row`] ([`run`], `case.rs`); a [`Folder`](super::Folder) keeps every finished
//! row as a file of its own, so that an interrupted study goes on where it was and several processes
//! share one folder. What a row says in `figures` is the same on every run, what it says in
//! `measured` (times, memory) is not.

mod case;
mod row;
mod selection;
mod table;

pub use case::{Advance, Case, Findings, Measured, Work, run};
pub use row::{Figures, Row};
pub use selection::{CaseArguments, Selection, Shard};
pub(crate) use table::{lines, markdown, rounded, write};
