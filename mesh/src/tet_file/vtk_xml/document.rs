//! The elements of a VTK XML file: the grid, pieces, their arrays, and the block of appended data.

use quick_xml::Reader;
use quick_xml::events::Event;

use super::array::{Array, Attributes, Layout};
use crate::tet_file::TetMeshError;

/// A VTK XML file, its arrays not yet decoded.
pub(crate) struct Document<'a> {
    pub(crate) layout: Layout<'a>,
    /// Attributes of the grid's element.
    pub(crate) grid: Attributes,
    pub(crate) pieces: Vec<Piece>,
}

/// A part of the grid.
pub(crate) struct Piece {
    pub(crate) attributes: Attributes,
    /// With the element that each stands in.
    pub(crate) arrays: Vec<(String, Array)>,
    /// The active scalars of `PointData` and `CellData`: element and array.
    pub(crate) scalars: Vec<(String, String)>,
}

impl Piece {
    /// A count that its element has as an attribute.
    pub(crate) fn count(&self, what: &str) -> Result<u64, TetMeshError> {
        let number = self.attributes.get(what).and_then(|n| n.trim().parse().ok());
        number.ok_or_else(|| self.attributes.wrong("Piece", what, "a count"))
    }

    fn find(&self, parent: &str, name: &str) -> Option<&Array> {
        let mut arrays = self.arrays.iter();
        let is_named = |array: &Array| array.name.eq_ignore_ascii_case(name);
        arrays.find(|(p, array)| p == parent && is_named(array)).map(|(_, array)| array)
    }

    /// The coordinates, whatever their name.
    pub(crate) fn points(&self) -> Result<&Array, TetMeshError> {
        let points = self.arrays.iter().find(|(parent, _)| parent == "Points");
        let missing = || TetMeshError::syntax("Piece", "no Points", "an array of points");
        points.map(|(_, array)| array).ok_or_else(missing)
    }

    pub(crate) fn topology(&self, name: &str) -> Result<&Array, TetMeshError> {
        self.of("Cells", name)
    }

    /// An array of the connectivity, in the element `section`.
    pub(crate) fn of(&self, section: &str, name: &str) -> Result<&Array, TetMeshError> {
        self.find(section, name).ok_or_else(|| {
            let found = format!("no array {name:?}");
            TetMeshError::syntax(section, found, "types, offsets, connectivity")
        })
    }

    pub(crate) fn cell_array(&self, name: &str) -> Option<&Array> {
        self.find("CellData", name)
    }
}

impl<'a> Document<'a> {
    /// Reads a file whose grid is of this type, e.g. `ImageData`.
    pub(crate) fn parse(bytes: &'a [u8], grid: &'static str) -> Result<Self, TetMeshError> {
        const END: &str = "the end of the file";
        let layout = Layout { header: 4, base64: true, ..Layout::default() };
        let mut document = Self { layout, grid: Attributes::default(), pieces: Vec::new() };
        // Raw appended data are no XML: what comes before is read on its own.
        let cut = find(bytes, b"<AppendedData").unwrap_or(bytes.len());
        if let Some(length) = find(&bytes[cut..], b"</AppendedData>") {
            document.append(&bytes[cut..cut + length])?;
        } else if cut < bytes.len() {
            return Err(TetMeshError::syntax("AppendedData", END, "</AppendedData>"));
        }
        let closed = document.elements(&bytes[..cut], grid)?;
        if !closed && cut == bytes.len() {
            return Err(TetMeshError::syntax(format!("byte {cut}"), END, "</VTKFile>"));
        }
        Ok(document)
    }

    /// The element `<AppendedData encoding="…">_…`, without its end.
    fn append(&mut self, element: &'a [u8]) -> Result<(), TetMeshError> {
        let want = "encoding=\"raw\" or \"base64\", _data";
        let wrong = |found: &str| TetMeshError::syntax("AppendedData", found, want);
        let head = find(element, b">").ok_or_else(|| wrong("no end of the tag"))?;
        let tag = String::from_utf8_lossy(&element[..head]).replace('\'', "\"");
        let base64 = match tag.split("encoding=\"").nth(1).and_then(|rest| rest.split('"').next()) {
            Some("base64") => true,
            Some("raw") => false,
            other => return Err(wrong(other.unwrap_or("no encoding"))),
        };
        let start = find(element, b"_").filter(|&at| at > head);
        let start = start.ok_or_else(|| wrong("no underscore"))?;
        (self.layout.base64, self.layout.appended) = (base64, &element[start + 1..]);
        Ok(())
    }

    /// Collects pieces and arrays; true if the root element is closed.
    fn elements(&mut self, xml: &[u8], grid: &'static str) -> Result<bool, TetMeshError> {
        // Bytes that are no text may stand in comments.
        let xml = String::from_utf8_lossy(xml);
        let mut reader = Reader::from_str(&xml);
        reader.config_mut().expand_empty_elements = true;
        let mut open: Vec<String> = Vec::new();
        loop {
            let event = reader.read_event();
            let place = format!("byte {}", reader.buffer_position());
            match event.map_err(|e| TetMeshError::syntax(&place, e.to_string(), "XML"))? {
                Event::Start(tag) => {
                    let name = tag.name().as_ref().to_string();
                    self.start(&open, &name, Attributes::read(&place, &tag)?, grid)?;
                    open.push(name);
                }
                Event::Text(text) if open.last().is_some_and(|name| name == "DataArray") => {
                    let piece = self.pieces.last_mut();
                    if let Some((_, array)) = piece.and_then(|piece| piece.arrays.last_mut()) {
                        array.text.extend_from_slice(text.as_bytes());
                    }
                }
                Event::End(_) => {
                    open.pop();
                    if open.is_empty() {
                        return Ok(true);
                    }
                }
                Event::Eof => return Ok(false),
                _ => {}
            }
        }
    }

    fn start(
        &mut self,
        open: &[String],
        name: &str,
        tag: Attributes,
        grid: &'static str,
    ) -> Result<(), TetMeshError> {
        let wrong = |what, want| tag.wrong(name, what, want);
        match (open.last().map(String::as_str), name) {
            (None, "VTKFile") => {
                if tag.get("type") != Some(grid) {
                    return Err(wrong("type", grid));
                }
                let big_endian = match tag.get("byte_order") {
                    None | Some("LittleEndian") => false,
                    Some("BigEndian") => true,
                    _ => return Err(wrong("byte_order", "LittleEndian or BigEndian")),
                };
                let header = match tag.get("header_type") {
                    None | Some("UInt32") => 4,
                    Some("UInt64") => 8,
                    _ => return Err(wrong("header_type", "UInt32 or UInt64")),
                };
                (self.layout.big_endian, self.layout.header) = (big_endian, header);
                self.layout.compressor = tag.get("compressor").unwrap_or_default().into();
            }
            (None, _) => {
                return Err(TetMeshError::syntax("start", format!("<{name}>"), "<VTKFile>"));
            }
            (Some("VTKFile"), name) if name == grid => self.grid = tag,
            (Some(parent), "Piece") if parent == grid => {
                let (arrays, scalars) = (Vec::new(), Vec::new());
                self.pieces.push(Piece { attributes: tag, arrays, scalars });
            }
            (Some("Piece"), "PointData" | "CellData") => {
                if let (Some(piece), Some(scalars)) = (self.pieces.last_mut(), tag.get("Scalars")) {
                    piece.scalars.push((name.into(), scalars.into()));
                }
            }
            (Some(parent), "DataArray" | "Array") => {
                let array = Array::new(&tag)?;
                if let Some(piece) = self.pieces.last_mut() {
                    piece.arrays.push((parent.to_string(), array));
                }
            }
            _ => {}
        }
        Ok(())
    }
}

fn find(bytes: &[u8], pattern: &[u8]) -> Option<usize> {
    bytes.windows(pattern.len()).position(|window| window == pattern)
}
