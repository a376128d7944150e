//! Surfaces as VTK XML PolyData, for ParaView and VTK.

use std::path::Path;

use super::error::SurfaceError;
use super::surface_data::{SurfaceData, replace};

/// Writes a surface to `path` (.vtp), replacing what stands there only once the file is whole.
///
/// Points `Float64` in scanner RAS mm; point data `displacement` (`Float64`, mm) and `label`
/// (`Int64`) where given. Arrays are appended raw, little-endian, each after its length as a
/// `UInt64`. The same data gives the same bytes. Cost: O(points + triangles).
///
/// # Errors
/// [`SurfaceError::EntryCount`], [`SurfaceError::EntryNotFinite`] or [`SurfaceError::TriangleCorner`] if
/// the data does not fit together; [`SurfaceError::Io`] if the file can't be written.
/// # Source
/// VTK File Formats, section «XML File Formats», version 1.0 of the format.
pub fn write_vtp(path: &Path, data: &SurfaceData<'_>) -> Result<(), SurfaceError> {
    data.check()?;
    let mut appended = Vec::new();
    let mut array =
        |kind: &str, name: &str, components: usize, values: &mut dyn Iterator<Item = [u8; 8]>| {
            let offset = appended.len();
            appended.extend([0; 8]);
            appended.extend(values.flatten());
            let length = (appended.len() - offset - 8) as u64;
            appended[offset..offset + 8].copy_from_slice(&length.to_le_bytes());
            format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" \
             format=\"appended\" offset=\"{offset}\"/>\n"
            )
        };
    let mut coordinates = data.points_mm.iter().flatten().map(|c| c.to_le_bytes());
    let points = array("Float64", "points", 3, &mut coordinates);
    let mut corners = data.triangles.iter().flatten().map(|&c| i64::from(c).to_le_bytes());
    let mut polygons = array("Int64", "connectivity", 1, &mut corners);
    let mut ends = (1..=data.triangles.len() as i64).map(|n| (3 * n).to_le_bytes());
    polygons += &array("Int64", "offsets", 1, &mut ends);
    let mut point_data = String::new();
    if let Some(displacement) = data.displacement_mm {
        let mut values = displacement.iter().flatten().map(|c| c.to_le_bytes());
        point_data += &array("Float64", "displacement", 3, &mut values);
    }
    if let Some(label) = data.label {
        let mut values = label.iter().map(|label| label.to_le_bytes());
        point_data += &array("Int64", "label", 1, &mut values);
    }
    let head = format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n<PolyData>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n\
         <Points>\n{points}</Points>\n<Polys>\n{polygons}</Polys>\n\
         <PointData>\n{point_data}</PointData>\n</Piece>\n</PolyData>\n\
         <AppendedData encoding=\"raw\">\n_",
        data.points_mm.len(),
        data.triangles.len()
    );
    let mut bytes = head.into_bytes();
    bytes.append(&mut appended);
    bytes.extend(b"\n</AppendedData>\n</VTKFile>\n");
    replace(path, &bytes)
}
