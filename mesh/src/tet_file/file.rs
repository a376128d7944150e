//! What the readers and writers of mesh files share: bytes, units, and the mesh of what was read.

use std::collections::BTreeMap;
use std::path::Path;
use std::{fs, io};

use nalgebra::Vector3;

use super::check;
use super::error::TetMeshError;
use super::mesh::{LoadedMesh, PlainMesh};
use crate::atomic_file;

/// What a file holds, coordinates in its own unit.
#[derive(Default)]
pub(crate) struct Content {
    pub points: Vec<Vector3<f64>>,
    pub tets: Vec<[u32; 4]>,
    pub tags: Vec<i64>,
    pub ignored_elements: usize,
    pub names: BTreeMap<i64, String>,
}

/// The mesh of a file whose bytes `parse` understands.
pub(crate) fn load(
    path: &Path,
    unit_m: f64,
    parse: impl FnOnce(&[u8]) -> Result<Content, TetMeshError>,
) -> Result<LoadedMesh, TetMeshError> {
    check_unit(unit_m)?;
    let load = || -> Result<LoadedMesh, TetMeshError> {
        let Content { points, tets, tags, ignored_elements, names } = parse(&read(path)?)?;
        let points = points.into_iter().map(|x| x * unit_m).collect();
        let (mesh, repairs) = PlainMesh::new(points, tets, tags)?;
        Ok(LoadedMesh { mesh, repairs, ignored_elements, names })
    };
    load().map_err(TetMeshError::in_file(path))
}

/// Refuses a length of a file unit that is no length.
fn check_unit(unit_m: f64) -> Result<(), TetMeshError> {
    if unit_m > 0.0 && unit_m.is_finite() { Ok(()) } else { Err(TetMeshError::LengthUnit(unit_m)) }
}

/// All bytes of a regular file.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    // A pipe or a device might never end.
    if !fs::metadata(path)?.is_file() {
        let kind = io::ErrorKind::InvalidInput;
        return Err(io::Error::new(kind, "no regular file, want a mesh file"));
    }
    fs::read(path)
}

/// Writes `bytes` to `path`, replacing what stands there only once the file is whole.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), TetMeshError> {
    atomic_file::write(path, bytes).map_err(TetMeshError::in_file(path))
}

/// The points of a mesh in units of `unit_m` metres.
pub(crate) fn in_units(mesh: &PlainMesh, unit_m: f64) -> Result<Vec<Vector3<f64>>, TetMeshError> {
    check_unit(unit_m)?;
    let points: Vec<_> = mesh.points().iter().map(|&x| x / unit_m).collect();
    check::finite(&points)?;
    Ok(points)
}

impl TetMeshError {
    /// Names the file that an error is about.
    pub(crate) fn in_file<E: Into<Self>>(path: &Path) -> impl Fn(E) -> Self {
        move |error| Self::InFile { path: path.into(), source: Box::new(error.into()) }
    }

    pub(crate) fn syntax(
        place: impl AsRef<str>,
        found: impl AsRef<str>,
        want: impl Into<String>,
    ) -> Self {
        let (place, found) = (shortened(place.as_ref()), shortened(found.as_ref()));
        Self::Syntax { place, found, want: want.into() }
    }

    pub(crate) fn unsupported(place: &str, found: &str, advice: &'static str) -> Self {
        Self::Unsupported { place: shortened(place), found: shortened(found), advice }
    }
}

/// The start of a text from a file: damaged ones have words of megabytes.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.into(),
    }
}
