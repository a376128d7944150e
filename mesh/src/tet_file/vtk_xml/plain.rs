//! Writes plain meshes with fields as VTK XML (.vtu), base64.

use std::path::Path;

use super::writer::{VtkArray, VtkValues, tetrahedra_xml};
use crate::tet_file::TetMeshError;
use crate::tet_file::file;
use crate::tet_file::mesh::PlainMesh;

/// Numbers per point or per tetrahedron, to be written with a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshField<'a> {
    /// Its name in the file; `label` is taken by the material tags.
    pub name: &'a str,
    /// Numbers per point or tetrahedron: 1, or 3 for vectors.
    pub components: usize,
    /// The numbers, components fastest.
    pub values: &'a [f64],
}

/// Writes `mesh` to `path` (.vtu) with its material tags as cell array `label`.
///
/// Units: coordinates are divided by `unit_m` (metres per file unit); fields are written as they
/// are. With `unit_m` 1 reading gives back the same mesh, bit for bit. The file is written
/// beside `path` and renamed. Cost: O(n).
///
/// # Errors
/// [`TetMeshError::LengthUnit`]; [`TetMeshError::ListLength`] for a field that does not fit the
/// mesh; [`TetMeshError::NotFinite`] for a number that ParaView could not read;
/// [`TetMeshError::Io`].
/// # Source
/// VTK file formats, <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.
pub fn write_vtu_plain<'a>(
    path: &Path,
    mesh: &PlainMesh,
    unit_m: f64,
    point_fields: &[MeshField<'a>],
    cell_fields: &[MeshField<'a>],
) -> Result<(), TetMeshError> {
    let points = file::in_units(mesh, unit_m)?;
    check(point_fields, points.len())?;
    check(cell_fields, mesh.tets().len())?;
    let field = |field: &MeshField<'a>| {
        let &MeshField { name, components, values } = field;
        VtkArray { name, components, values: VtkValues::Float64(values) }
    };
    let label = VtkArray { name: "label", components: 1, values: VtkValues::Int64(mesh.tags()) };
    let point_data: Vec<VtkArray> = point_fields.iter().map(field).collect();
    let cell_data: Vec<VtkArray> =
        [label].into_iter().chain(cell_fields.iter().map(field)).collect();
    let coordinates: Vec<f64> = points.iter().flatten().copied().collect();
    file::write(path, &tetrahedra_xml(&coordinates, mesh.tets(), &point_data, &cell_data))
}

fn check(fields: &[MeshField], count: usize) -> Result<(), TetMeshError> {
    for field in fields {
        let what = || format!("field {:?}", field.name);
        let want = count.saturating_mul(field.components);
        if field.values.len() != want || field.components == 0 {
            let found = field.values.len();
            return Err(TetMeshError::ListLength { what: what(), found, want });
        }
        if let Some(index) = field.values.iter().position(|v| !v.is_finite()) {
            let value = field.values[index];
            return Err(TetMeshError::NotFinite { what: what(), index, value });
        }
    }
    Ok(())
}
