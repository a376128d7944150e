//! Files of a run, there whole or not at all.

use std::path::Path;

use serde::Serialize;
use yawara_mesh::atomic_file;

use crate::SimError;

/// Writes `bytes` to `path`, replacing what stands there only once the file is whole.
/// # Errors
/// [`SimError::Io`]; what stood at `path` is still there then.
pub fn write_file(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), SimError> {
    atomic_file::write(path, bytes).map_err(|source| SimError::Io(path.into(), source))
}

/// Writes `value` to `path` as JSON, as [`write_file`] does.
/// # Errors
/// [`SimError::Io`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), SimError> {
    let json = serde_json::to_string_pretty(value);
    write_file(path, json.map_err(|error| SimError::Io(path.into(), error.into()))? + "\n")
}
