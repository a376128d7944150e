//! What a surface file holds, checked.

use std::path::Path;

use nalgebra::Vector3;

use super::error::SurfaceError;
use crate::atomic_file;

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

/// Writes `bytes` to `path`, replacing what stands there only once the file is whole.
///
/// # Errors
/// [`SurfaceError::Io`], naming `path`.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> Result<(), SurfaceError> {
    atomic_file::write(path, bytes).map_err(|source| SurfaceError::Io { path: path.into(), source })
}
