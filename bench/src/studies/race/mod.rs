//! A race: all maintainers and direct methods side by side, at one size after the other.
//!
//! Every family of rings has the same mesh and the same places of splits and merges. Updates come
//! in bursts: within one, a method finds its own numbers in the caches, as it does in use; from
//! burst to burst the methods take turns and another one begins, so that all of them meet the
//! same machine. Start with `run.rs`; `workload.rs` makes the bursts, `competitor.rs` runs them,
//! `row.rs` and `ratios.rs` say what was found, `tables.rs` shows it.

mod at_size;
mod competitor;
mod growth;
mod memory;
mod ratios;
mod row;
mod run;
mod samples;
mod settings;
mod tables;
mod workload;

pub(crate) use at_size::{AtSize, rows};
pub(crate) use ratios::beside;
pub(crate) use row::Row;
pub(crate) use run::run;
pub use settings::Arguments;
pub(crate) use settings::{Defaults, FAMILIES, maintainers};
pub(crate) use tables::{families, head, left_out, lines, ratio_table};
