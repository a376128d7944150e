//! Competitors side by side: one study per file, with its report; two of them share their race.

pub mod ablation;
mod arguments;
pub mod compare;
pub mod drift;
pub mod elements;
pub mod extremes;
pub mod homogenisation;
mod homogenisation_cases;
mod homogenisation_solve;
mod homogenisation_tables;
pub(crate) mod markdown;
pub mod mesh;
pub mod mesh_updates;
pub mod mesh_volumes;
pub mod pareto;
mod race;
mod race_tables;
pub mod scaling;
pub mod stiff;
mod sweep;
pub mod table1;
#[cfg(feature = "gpu")]
pub mod table1_gpu;
pub mod validate;

pub use arguments::{Arguments, CaseArguments, Common};

use std::path::Path;

use serde::Serialize;

use crate::error::BenchError;

/// A report as a JSON text.
fn json(report: &impl Serialize, directory: &Path, name: &str) -> Result<String, BenchError> {
    let text = serde_json::to_string_pretty(report);
    let text =
        text.map_err(|error| BenchError::Io { path: directory.join(name), source: error.into() })?;
    Ok(text + "\n")
}
