//! What all studies share: one scaffold that makes files, tables and charts of what they measure.
//!
//! Start with [`report`]: [`write`](report::write) makes CSV, JSON, tables and charts of a study's rows
//! and what is said of them. [`cases`] makes rows of cases that are run one by one and kept one by one; [`ranks`] shares them among processes.
//! `plot` draws, `arguments` is the command line that studies have in common, `folder` writes,
//! `machine`, `progress` and `statistics` are what their names say.

pub mod arguments;
pub mod cases;
mod folder;
pub(crate) mod machine;
pub mod plot;
mod progress;
pub mod ranks;
pub mod report;
pub(crate) mod statistics;

pub use arguments::Common;
pub use folder::Folder;
pub use machine::Machine;
pub use progress::Progress;
