//! Competitors side by side: one study per file, with its command line arguments and its report.

pub mod inverse;
mod inverse_report;
pub mod mesh;
pub mod mesh_updates;
pub mod mesh_volumes;
