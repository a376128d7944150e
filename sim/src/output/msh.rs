//! One frame as a Gmsh mesh.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;
use yawara_mesh::PlainMesh;
use yawara_mesh::tet_file::write_msh41;

use crate::SimError;
use crate::report::Frame;

/// Writes the tetrahedra of a frame to `path` as MSH 4.1 text, replacing what stands there only
/// once the file is whole.
///
/// Points in scanner RAS, mm, as deformed; labels become physical groups. Inverted tetrahedra
/// are written with positive winding. Where a cut of the body ends, its sheets share a face. Cost: O(n log n).
/// # Errors
/// [`SimError::TetMesh`] for a flat tetrahedron, a label beyond 0 to 2³¹ − 1, or if the file can't
/// be written.
pub fn write_msh(path: &Path, frame: &Frame) -> Result<(), SimError> {
    let points = frame.points_mm.iter().map(|&x| Vector3::from(x)).collect();
    let (mesh, _) = PlainMesh::with_sheets(points, frame.tets.clone(), frame.label.clone())?;
    // The mesh is in the file's own unit already.
    Ok(write_msh41(path, &mesh, &BTreeMap::new(), 1.0)?)
}
