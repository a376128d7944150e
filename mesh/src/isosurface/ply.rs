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
    let wrong = |field, value, want| Err(SurfaceError::IsoSurface { field, value, want });
    if data.points_mm.len() > 1 << 31 {
        return wrong("number of points", data.points_mm.len() as f64, "at most 2^31");
    }
    let labels = data.label.unwrap_or_default();
    if let Some(&label) = labels.iter().find(|&&label| i32::try_from(label).is_err()) {
        let want = "a 32-bit integer in a PLY file; write a VTP file instead";
        return wrong("label", label as f64, want);
    }
    let mut bytes = header(data, encoding).into_bytes();
    match encoding {
        PlyEncoding::Ascii => bytes.extend(text(data).into_bytes()),
        PlyEncoding::BinaryLittleEndian => binary(data, &mut bytes),
    }
    replace(path, &bytes)
}

fn header(data: &SurfaceData<'_>, encoding: PlyEncoding) -> String {
    let format = match encoding {
        PlyEncoding::Ascii => "ascii",
        PlyEncoding::BinaryLittleEndian => "binary_little_endian",
    };
    let (points, faces) = (data.points_mm.len(), data.triangles.len());
    let mut header =
        format!("ply\nformat {format} 1.0\ncomment scanner RAS, mm\nelement vertex {points}\n");
    let prefixes = if data.displacement_mm.is_some() { &["", "displacement_"][..] } else { &[""] };
    for prefix in prefixes {
        for axis in ["x", "y", "z"] {
            header += &format!("property double {prefix}{axis}\n");
        }
    }
    if data.label.is_some() {
        header += "property int label\n";
    }
    header + &format!("element face {faces}\nproperty list uchar int vertex_indices\nend_header\n")
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
