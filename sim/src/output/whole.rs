//! Files that are there whole or not at all.

use std::fs;
use std::path::{Path, PathBuf};

use crate::SimError;

/// Writes a file beside `path` and renames it once it is whole.
///
/// # Errors
/// [`SimError::Io`]; what stood at `path` is still there then.
pub fn write_whole(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), SimError> {
    let io = |source| SimError::Io { path: path.into(), source };
    let aside = Aside::new(path)?;
    fs::write(&aside.path, bytes).map_err(io)?;
    fs::rename(&aside.path, path).map_err(io)
}

/// A file beside the one wanted; removed if it is still there when dropped.
struct Aside {
    path: PathBuf,
}

impl Aside {
    fn new(path: &Path) -> Result<Self, SimError> {
        let Some(name) = path.file_name() else {
            let source = std::io::Error::from(std::io::ErrorKind::InvalidFilename);
            return Err(SimError::Io { path: path.into(), source });
        };
        let mut aside = std::ffi::OsString::from(".");
        aside.push(name);
        aside.push(format!(".{}.partial", std::process::id()));
        Ok(Self { path: path.with_file_name(aside) })
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        // After the rename there is nothing left to remove, and that is no error.
        let _ = fs::remove_file(&self.path);
    }
}
