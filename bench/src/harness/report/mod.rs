//! From the rows of a study to its files and to what it prints.
//!
//! `summary.rs` writes the files; `cells.rs` makes CSV of any rows that serde can
//! write, `pivot.rs` spreads rows over tables and charts, `markdown.rs` writes the tables, `claim.rs`
//! says what is claimed of a figure and whether it holds.

mod cells;
mod claim;
pub(crate) mod markdown;
mod pivot;
mod summary;

pub(crate) use cells::{cell, csv, objects};
pub use claim::Claim;
pub(crate) use claim::Limit;
pub(crate) use pivot::{curves, each_once, spread};
pub use summary::{Summary, write};
