//! Surfaces as VTK XML PolyData, for ParaView and VTK.

use std::path::Path;

use nalgebra::Vector3;

use super::error::SurfaceError;
use super::surface_data::{SurfaceData, replace};
use crate::tet_file::{VtkArray, VtkValues, triangles_xml};

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
    let displacement = data.displacement_mm.map(coordinates);
    let mut point_data = Vec::new();
    if let Some(values) = &displacement {
        let values = VtkValues::Float64(values);
        point_data.push(VtkArray { name: "displacement_mm", components: 3, values });
    }
    if let Some(label) = data.label {
        let values = VtkValues::Int64(label);
        point_data.push(VtkArray { name: "label", components: 1, values });
    }
    replace(path, &triangles_xml(&coordinates(data.points_mm), data.triangles, &point_data))
}

fn coordinates(vectors: &[Vector3<f64>]) -> Vec<f64> {
    vectors.iter().flatten().copied().collect()
}
