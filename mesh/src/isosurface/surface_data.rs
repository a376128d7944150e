//! What a surface file holds, checked; files replaced only once they are whole.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::error::SurfaceError;

/// The content of a surface file, borrowed; checked when it is written.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceData<'a> {
    /// Points, scanner RAS mm.
    pub points_mm: &'a [Vector3<f64>],
    /// Corners by position in `points_mm`, counter-clockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Displacement from the rest shape, mm, one per point.
    pub displacement_mm: Option<&'a [Vector3<f64>]>,
    /// Original label, one per point.
    pub label: Option<&'a [i64]>,
}

impl SurfaceData<'_> {
    /// # Errors
    /// [`SurfaceError::EntryCount`], [`SurfaceError::EntryNotFinite`], [`SurfaceError::TriangleCorner`].
    pub(super) fn check(&self) -> Result<(), SurfaceError> {
        let points = self.points_mm.len();
        let lengths = [
            ("displacement_mm", self.displacement_mm.map(<[_]>::len)),
            ("label", self.label.map(<[_]>::len)),
        ];
        for (what, length) in lengths {
            if let Some(found) = length.filter(|&found| found != points) {
                return Err(SurfaceError::EntryCount { what, found, want: points });
            }
        }
        finite("points_mm", self.points_mm)?;
        finite("displacement_mm", self.displacement_mm.unwrap_or(&[]))?;
        for (triangle, corners) in self.triangles.iter().enumerate() {
            if let Some(&corner) = corners.iter().find(|&&c| c as usize >= points) {
                return Err(SurfaceError::TriangleCorner { triangle, corner, points });
            }
        }
        Ok(())
    }
}

fn finite(what: &'static str, vectors: &[Vector3<f64>]) -> Result<(), SurfaceError> {
    for (index, vector) in vectors.iter().enumerate() {
        if let Some(&value) = vector.iter().find(|c| !c.is_finite()) {
            return Err(SurfaceError::EntryNotFinite { what, index, value });
        }
    }
    Ok(())
}

/// Writes `bytes` beside `path`, then renames: whoever reads `path` sees the old file or the
/// whole new one.
///
/// # Errors
/// [`SurfaceError::Io`], naming `path`.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> Result<(), SurfaceError> {
    let io = |source| SurfaceError::Io { path: path.into(), source };
    let Some(name) = path.file_name() else {
        return Err(io(std::io::ErrorKind::InvalidFilename.into()));
    };
    let mut aside = std::ffi::OsString::from(".");
    aside.push(name);
    aside.push(format!(".{}.partial", std::process::id()));
    let aside: PathBuf = path.with_file_name(aside);
    let written = fs::write(&aside, bytes).and_then(|()| fs::rename(&aside, path));
    if written.is_err() {
        // The error is the one to report; a file that was never begun can't be removed.
        let _ = fs::remove_file(&aside);
    }
    written.map_err(io)
}
