//! Writes VTK XML files: every .vtu and .vtp of the workspace comes from here.
//!
//! Little-endian, header type UInt64. The same data gives the same bytes.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// VTK's cell type of a tetrahedron.
const TETRAHEDRON: u8 = 10;

/// The numbers of an array in the type that they are written in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VtkValues<'a> {
    /// `UInt8`.
    UInt8(&'a [u8]),
    /// `Int64`.
    Int64(&'a [i64]),
    /// `Float64`.
    Float64(&'a [f64]),
}

/// A named array of point data or cell data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VtkArray<'a> {
    /// Its name, or "" for none.
    pub name: &'a str,
    /// Numbers per point or cell: 1, or 3 for vectors.
    pub components: usize,
    /// The numbers, components fastest.
    pub values: VtkValues<'a>,
}

impl VtkValues<'_> {
    /// True without numbers.
    pub fn is_empty(&self) -> bool {
        match self {
            Self::UInt8(values) => values.is_empty(),
            Self::Int64(values) => values.is_empty(),
            Self::Float64(values) => values.is_empty(),
        }
    }

    fn kind(self) -> &'static str {
        match self {
            Self::UInt8(_) => "UInt8",
            Self::Int64(_) => "Int64",
            Self::Float64(_) => "Float64",
        }
    }

    /// Appends the number of bytes, then the numbers.
    fn append_to(self, bytes: &mut Vec<u8>) {
        let mut length = |count: usize| bytes.extend((count as u64).to_le_bytes());
        match self {
            Self::UInt8(values) => {
                length(values.len());
                bytes.extend(values);
            }
            Self::Int64(values) => {
                length(8 * values.len());
                bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            }
            Self::Float64(values) => {
                length(8 * values.len());
                bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            }
        }
    }
}

/// Tetrahedra as an unstructured grid (.vtu), the arrays in base64.
///
/// `points`: x, y, z of each point; arrays of `point_data` and `cell_data` have one entry per
/// point and tetrahedron, which is not checked. Connectivity and offsets are signed, as ParaView
/// writes them: meshio turns unsigned ones into floats. Cost: O(n).
/// # Source
/// VTK file formats, <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.
pub fn tetrahedra_xml(
    points: &[f64],
    tets: &[[u32; 4]],
    point_data: &[VtkArray],
    cell_data: &[VtkArray],
) -> Vec<u8> {
    let mut document = Document::new("UnstructuredGrid", false);
    document.piece(points.len() / 3, Some(tets.len()), 0);
    document.data("PointData", point_data);
    document.data("CellData", cell_data);
    document.points("", points);
    document.cells("Cells", tets, Some(&vec![TETRAHEDRON; tets.len()]));
    document.finish()
}

/// Triangles as PolyData (.vtp), the arrays raw behind the XML.
///
/// Arguments as of [`tetrahedra_xml`].
pub(crate) fn triangles_xml(
    points: &[f64],
    triangles: &[[u32; 3]],
    point_data: &[VtkArray],
) -> Vec<u8> {
    let mut document = Document::new("PolyData", true);
    document.piece(points.len() / 3, None, triangles.len());
    document.data("PointData", point_data);
    document.points("points", points);
    document.cells("Polys", triangles, None);
    document.finish()
}

/// A file in the making.
struct Document {
    kind: &'static str,
    text: String,
    /// The bytes of arrays: all of them where they are appended, else of the last one.
    bytes: Vec<u8>,
    appended: bool,
}

impl Document {
    fn new(kind: &'static str, appended: bool) -> Self {
        let text = format!(
            "<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\"><{kind}>"
        );
        Self { kind, text, bytes: Vec::new(), appended }
    }

    /// Appends formatted text, which can't fail.
    fn push(&mut self, text: std::fmt::Arguments) {
        let _ = self.text.write_fmt(text);
    }

    fn piece(&mut self, points: usize, cells: Option<usize>, polygons: usize) {
        self.push(format_args!("<Piece NumberOfPoints=\"{points}\""));
        if let Some(cells) = cells {
            self.push(format_args!(" NumberOfCells=\"{cells}\""));
        }
        self.push(format_args!(
            " NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{polygons}\" \
             NumberOfVerts=\"0\">"
        ));
    }

    /// Point or cell data; its first scalar and vector are what ParaView shows first.
    fn data(&mut self, section: &str, arrays: &[VtkArray]) {
        self.push(format_args!("<{section}"));
        for (role, components) in [("Scalars", 1), ("Vectors", 3)] {
            if let Some(first) = arrays.iter().find(|array| array.components == components) {
                let name = escaped(first.name);
                self.push(format_args!(" {role}=\"{name}\""));
            }
        }
        self.text.push('>');
        for array in arrays {
            self.array(array);
        }
        self.push(format_args!("</{section}>"));
    }

    fn points(&mut self, name: &str, points: &[f64]) {
        self.text.push_str("<Points>");
        self.array(&VtkArray { name, components: 3, values: VtkValues::Float64(points) });
        self.text.push_str("</Points>");
    }

    fn cells<const N: usize>(&mut self, section: &str, cells: &[[u32; N]], types: Option<&[u8]>) {
        let corners: Vec<i64> = cells.as_flattened().iter().map(|&v| v.into()).collect();
        let ends: Vec<i64> = (1..=cells.len()).map(|cell| (N * cell) as i64).collect();
        let scalars = |name, values| VtkArray { name, components: 1, values };
        self.push(format_args!("<{section}>"));
        self.array(&scalars("connectivity", VtkValues::Int64(&corners)));
        self.array(&scalars("offsets", VtkValues::Int64(&ends)));
        if let Some(types) = types {
            self.array(&scalars("types", VtkValues::UInt8(types)));
        }
        self.push(format_args!("</{section}>"));
    }

    fn array(&mut self, &VtkArray { name, components, values }: &VtkArray) {
        self.push(format_args!("<DataArray type=\"{}\"", values.kind()));
        if !name.is_empty() {
            self.push(format_args!(" Name=\"{}\"", escaped(name)));
        }
        if self.appended {
            let offset = self.bytes.len();
            self.push(format_args!(
                " format=\"appended\" NumberOfComponents=\"{components}\" offset=\"{offset}\"/>"
            ));
            values.append_to(&mut self.bytes);
            return;
        }
        self.push(format_args!(" format=\"binary\" NumberOfComponents=\"{components}\">"));
        self.bytes.clear();
        values.append_to(&mut self.bytes);
        STANDARD.encode_string(&self.bytes, &mut self.text);
        self.text.push_str("</DataArray>");
    }

    fn finish(mut self) -> Vec<u8> {
        let kind = self.kind;
        self.push(format_args!("</Piece></{kind}>"));
        let mut file = self.text.into_bytes();
        if self.appended {
            file.extend(b"<AppendedData encoding=\"raw\">\n_");
            file.append(&mut self.bytes);
            file.extend(b"\n</AppendedData>\n");
        }
        file.extend(b"</VTKFile>");
        if self.appended {
            file.push(b'\n');
        }
        file
    }
}

/// A name as the value of an XML attribute.
fn escaped(name: &str) -> String {
    let mut text = name.replace('&', "&amp;");
    for (character, entity) in [('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;"), ('\'', "&apos;")] {
        text = text.replace(character, entity);
    }
    text
}
