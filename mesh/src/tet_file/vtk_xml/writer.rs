//! Writes plain meshes with fields as VTK XML (.vtu), base64.

use std::fmt::Write;
use std::path::Path;

use crate::tet_file::TetMeshError;
use crate::tet_file::file;
use crate::tet_file::mesh::PlainMesh;

/// VTK's cell type of a tetrahedron.
const TETRAHEDRON: u8 = 10;

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
pub fn write_vtu_plain(
    path: &Path,
    mesh: &PlainMesh,
    unit_m: f64,
    point_fields: &[MeshField],
    cell_fields: &[MeshField],
) -> Result<(), TetMeshError> {
    let points = file::in_units(mesh, unit_m)?;
    let (n, cells) = (points.len(), mesh.tets().len());
    check(point_fields, n)?;
    check(cell_fields, cells)?;
    let mut xml = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" \
         byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n",
    );
    let _ = writeln!(xml, "<Piece NumberOfPoints=\"{n}\" NumberOfCells=\"{cells}\">\n<Points>");
    let coordinates = points.iter().flat_map(|x| [x[0], x[1], x[2]]);
    array(&mut xml, ("Float64", "Points", 3), coordinates.map(f64::to_le_bytes));
    xml.push_str("</Points>\n<Cells>\n");
    let corners = mesh.tets().as_flattened().iter().map(|&v| i64::from(v).to_le_bytes());
    array(&mut xml, ("Int64", "connectivity", 1), corners);
    let offsets = (1..=cells as i64).map(|cell| (4 * cell).to_le_bytes());
    array(&mut xml, ("Int64", "offsets", 1), offsets);
    array(&mut xml, ("UInt8", "types", 1), (0..cells).map(|_| [TETRAHEDRON]));
    xml.push_str("</Cells>\n<PointData>\n");
    fields(&mut xml, point_fields);
    xml.push_str("</PointData>\n<CellData>\n");
    array(&mut xml, ("Int64", "label", 1), mesh.tags().iter().map(|tag| tag.to_le_bytes()));
    fields(&mut xml, cell_fields);
    xml.push_str("</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    file::write(path, xml.as_bytes())
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

fn fields(xml: &mut String, fields: &[MeshField]) {
    for field in fields {
        let name = quick_xml::escape::escape(field.name.as_bytes());
        let name = String::from_utf8_lossy(&name);
        let values = field.values.iter().map(|v| v.to_le_bytes());
        array(xml, ("Float64", &name, field.components), values);
    }
}

/// An array of type, name and number of components.
fn array<const N: usize>(
    xml: &mut String,
    (kind, name, components): (&str, &str, usize),
    values: impl Iterator<Item = [u8; N]>,
) {
    let data: Vec<u8> = values.flatten().collect();
    let mut bytes = (data.len() as u64).to_le_bytes().to_vec();
    bytes.extend(data);
    let _ = write!(xml, "<DataArray type=\"{kind}\" Name=\"{name}\" ");
    // Said for scalars too, it makes meshio read columns in place of lists.
    if components != 1 {
        let _ = write!(xml, "NumberOfComponents=\"{components}\" ");
    }
    xml.push_str("format=\"binary\">\n");
    base64::encode_config_buf(&bytes, base64::STANDARD, xml);
    xml.push_str("\n</DataArray>\n");
}
