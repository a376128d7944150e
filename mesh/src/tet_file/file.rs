//! What the readers and writers of mesh files share: bytes and units.

use std::fs;
use std::io;
use std::path::Path;

use nalgebra::Vector3;

use super::error::TetMeshError;
use super::mesh::PlainMesh;
use crate::atomic_file;

/// Refuses a length of a file unit that is no length.
pub(crate) fn check_unit(unit_m: f64) -> Result<(), TetMeshError> {
    if unit_m > 0.0 && unit_m.is_finite() {
        Ok(())
    } else {
        Err(TetMeshError::LengthUnit { value: unit_m })
    }
}

/// All bytes of a regular file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, TetMeshError> {
    let io_error = |source| TetMeshError::Io { path: path.into(), source };
    // A pipe or a device might never end.
    if !fs::metadata(path).map_err(io_error)?.is_file() {
        let source =
            io::Error::new(io::ErrorKind::InvalidInput, "no regular file, want a mesh file");
        return Err(io_error(source));
    }
    fs::read(path).map_err(io_error)
}

/// Writes `bytes` to `path`, replacing what stands there only once the file is whole.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), TetMeshError> {
    atomic_file::write(path, bytes).map_err(|source| TetMeshError::Io { path: path.into(), source })
}

/// The points of a mesh in units of `unit_m` metres.
pub(crate) fn in_units(mesh: &PlainMesh, unit_m: f64) -> Result<Vec<Vector3<f64>>, TetMeshError> {
    check_unit(unit_m)?;
    let points: Vec<_> = mesh.points().iter().map(|&x| x / unit_m).collect();
    for (index, point) in points.iter().enumerate() {
        if let Some(&value) = point.iter().find(|c| !c.is_finite()) {
            return Err(TetMeshError::NotFinite { what: "point".into(), index, value });
        }
    }
    Ok(points)
}

/// The start of a text from a file: damaged ones have words of megabytes.
pub(crate) fn shortened(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.into(),
    }
}
