//! As much of a run's scene as playing it needs; the scene itself may be one of stages that are not built in.

use std::fs;
use std::path::Path;

use serde::Deserialize;

use super::wrong;
use crate::SimError;
use crate::scene::ToolEntry;

/// What a run was of.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Description {
    pub name: String,
    #[serde(default)]
    pub description: String,
    #[serde(default)]
    pub materials: Vec<Named>,
    #[serde(default)]
    pub tools: Vec<ToolEntry>,
    pub time: Clock,
}

/// A material by its label.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Named {
    pub label: Option<i64>,
    #[serde(default)]
    pub name: String,
}

/// The steps of a run.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct Clock {
    pub step_s: f64,
}

impl Description {
    /// Reads a `scene.toml`.
    ///
    /// # Errors
    /// [`SimError::Io`], [`SimError::Syntax`].
    pub fn read(path: &Path) -> Result<Self, SimError> {
        let text = fs::read_to_string(path).map_err(|source| SimError::Io(path.into(), source))?;
        toml::from_str(&text).map_err(|error| wrong(path, &error.message().replace('\n', "; ")))
    }
}
