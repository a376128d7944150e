//! Surfaces in the Stanford polygon format (PLY 1.0).

use std::fmt::Write;
use std::path::Path;

use super::error::SurfaceError;
use super::surface_data::{SurfaceData, replace};

/// How a PLY file holds its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlyEncoding {
    /// Text; numbers in the fewest digits that are read back to the same bits.
    Ascii,
    /// `binary_little_endian`.
    BinaryLittleEndian,
}

/// Writes a surface to `path` as PLY, replacing what stands there only once the file is whole.
///
/// Vertex properties: `double x y z` (scanner RAS mm), where given `double
/// displacement_x displacement_y displacement_z` (mm) and `int label`; faces `list uchar int
/// vertex_indices`. The same data gives the same bytes. Cost: O(points + triangles).
///
/// # Errors
/// [`SurfaceError::EntryCount`], [`SurfaceError::EntryNotFinite`] or [`SurfaceError::TriangleCorner`] if
/// the data does not fit together; [`SurfaceError::IsoSurface`] if a label or the number of points
/// is beyond the 32-bit integers of the format; [`SurfaceError::Io`] if the file can't be written.
pub fn write_ply(
    path: &Path,
    data: &SurfaceData<'_>,
    encoding: PlyEncoding,
) -> Result<(), SurfaceError> {
    data.check()?;
    let largest = data.points_mm.len() as i64 - 1;
    if let Some(value) = beyond_i32([largest].iter()) {
        let want = "at most 2^31";
        return Err(SurfaceError::IsoSurface {
            field: "number of points",
            value: value + 1.0,
            want,
        });
    }
    if let Some(value) = beyond_i32(data.label.unwrap_or(&[]).iter()) {
        let want = "a 32-bit integer in a PLY file; write a VTP file instead";
        return Err(SurfaceError::IsoSurface { field: "label", value, want });
    }
    let mut bytes = header(data, encoding).into_bytes();
    match encoding {
        PlyEncoding::Ascii => bytes.extend(text(data).into_bytes()),
        PlyEncoding::BinaryLittleEndian => binary(data, &mut bytes),
    }
    replace(path, &bytes)
}

fn beyond_i32<'a>(mut values: impl Iterator<Item = &'a i64>) -> Option<f64> {
    values.find(|&&value| i32::try_from(value).is_err()).map(|&value| value as f64)
}

fn header(data: &SurfaceData<'_>, encoding: PlyEncoding) -> String {
    let format = match encoding {
        PlyEncoding::Ascii => "ascii",
        PlyEncoding::BinaryLittleEndian => "binary_little_endian",
    };
    let mut header = format!(
        "ply\nformat {format} 1.0\ncomment scanner RAS, mm\nelement vertex {}\n",
        data.points_mm.len()
    );
    for axis in ["x", "y", "z"] {
        header += &format!("property double {axis}\n");
    }
    if data.displacement_mm.is_some() {
        for axis in ["x", "y", "z"] {
            header += &format!("property double displacement_{axis}\n");
        }
    }
    if data.label.is_some() {
        header += "property int label\n";
    }
    header
        + &format!(
            "element face {}\nproperty list uchar int vertex_indices\n",
            data.triangles.len()
        )
        + "end_header\n"
}

/// The real numbers of a point, in the order of the header.
fn reals<'a>(data: &SurfaceData<'a>, point: usize) -> impl Iterator<Item = f64> + use<'a> {
    let displacement = data.displacement_mm.map(|d| &d[point]).into_iter().flatten();
    data.points_mm[point].iter().chain(displacement).copied()
}

fn text(data: &SurfaceData<'_>) -> String {
    let mut text = String::new();
    for point in 0..data.points_mm.len() {
        let mut fields: Vec<String> =
            reals(data, point).map(|value| format!("{value:?}")).collect();
        fields.extend(data.label.map(|label| label[point].to_string()));
        text += &fields.join(" ");
        text.push('\n');
    }
    for [a, b, c] in data.triangles {
        // Writing to a string can't fail.
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text
}

fn binary(data: &SurfaceData<'_>, bytes: &mut Vec<u8>) {
    for point in 0..data.points_mm.len() {
        for value in reals(data, point) {
            bytes.extend(value.to_le_bytes());
        }
        if let Some(label) = data.label {
            bytes.extend((label[point] as i32).to_le_bytes());
        }
    }
    for triangle in data.triangles {
        bytes.push(3);
        for &corner in triangle {
            bytes.extend((corner as i32).to_le_bytes());
        }
    }
}
