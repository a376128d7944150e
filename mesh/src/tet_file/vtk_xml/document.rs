//! The elements of a .vtu file: pieces, their arrays, and the block of appended data.

use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::Event;

use super::array::Array;
use super::layout::{Attributes, Layout};
use crate::tet_file::TetMeshError;

/// A .vtu file, its arrays not yet decoded.
pub(super) struct Document<'a> {
    pub(super) layout: Layout<'a>,
    pub(super) pieces: Vec<Piece>,
}

/// A part of the grid.
pub(super) struct Piece {
    pub(super) points: u64,
    pub(super) cells: u64,
    /// With the element that each stands in.
    arrays: Vec<(String, Array)>,
}

impl Piece {
    fn find(&self, parent: &str, name: &str) -> Option<&Array> {
        let mut arrays = self.arrays.iter();
        arrays.find(|(p, array)| p == parent && array.name == name).map(|(_, array)| array)
    }

    /// The coordinates, whatever their name.
    pub(super) fn points(&self, layout: &Layout) -> Result<&Array, TetMeshError> {
        let points = self.arrays.iter().find(|(parent, _)| parent == "Points");
        let missing = || layout.syntax("Piece".into(), "no Points".into(), "an array of points");
        points.map(|(_, array)| array).ok_or_else(missing)
    }

    pub(super) fn topology(&self, layout: &Layout, name: &str) -> Result<&Array, TetMeshError> {
        self.find("Cells", name).ok_or_else(|| {
            layout.syntax(
                "Cells".into(),
                format!("no array {name:?}"),
                "types, offsets, connectivity",
            )
        })
    }

    pub(super) fn cell_array(&self, name: &str) -> Option<&Array> {
        self.find("CellData", name)
    }
}

impl<'a> Document<'a> {
    pub(super) fn parse(path: &'a Path, bytes: &'a [u8]) -> Result<Self, TetMeshError> {
        let layout = Layout {
            path,
            big_endian: false,
            header: 4,
            compressor: String::new(),
            base64: true,
            appended: &[],
        };
        let mut document = Self { layout, pieces: Vec::new() };
        // Raw appended data are no XML: what comes before is read on its own.
        let cut = find(bytes, b"<AppendedData").unwrap_or(bytes.len());
        if let Some(length) = find(&bytes[cut..], b"</AppendedData>") {
            document.append(&bytes[cut..cut + length])?;
        } else if cut < bytes.len() {
            let found = "the end of the file".into();
            return Err(document.layout.syntax("AppendedData".into(), found, "</AppendedData>"));
        }
        let closed = document.elements(&bytes[..cut])?;
        if !closed && cut == bytes.len() {
            let place = format!("byte {}", bytes.len());
            return Err(document.layout.syntax(place, "the end of the file".into(), "</VTKFile>"));
        }
        Ok(document)
    }

    /// The element `<AppendedData encoding="…">_…`, without its end.
    fn append(&mut self, element: &'a [u8]) -> Result<(), TetMeshError> {
        let wrong = |found: &str| {
            self.layout.syntax(
                "AppendedData".into(),
                found.into(),
                "encoding=\"raw\" or \"base64\", _data",
            )
        };
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
    fn elements(&mut self, xml: &[u8]) -> Result<bool, TetMeshError> {
        // Bytes that are no text may stand in comments.
        let xml = String::from_utf8_lossy(xml);
        let mut reader = Reader::from_str(&xml);
        reader.config_mut().expand_empty_elements = true;
        let mut open: Vec<String> = Vec::new();
        loop {
            let event = reader.read_event();
            let place = format!("byte {}", reader.buffer_position());
            match event.map_err(|e| self.layout.syntax(place.clone(), e.to_string(), "XML"))? {
                Event::Start(tag) => {
                    let name = tag.name().as_ref().to_string();
                    self.start(&open, &name, &Attributes::read(&self.layout, &place, &tag)?)?;
                    open.push(name);
                }
                Event::Text(text) if open.last().is_some_and(|name| name == "DataArray") => {
                    if let Some((_, array)) =
                        self.pieces.last_mut().and_then(|p| p.arrays.last_mut())
                    {
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

    fn start(&mut self, open: &[String], name: &str, tag: &Attributes) -> Result<(), TetMeshError> {
        let wrong = |what: &str, want: &str| {
            let found = format!("{what} {:?}", tag.get(what).unwrap_or("missing"));
            Err(self.layout.syntax(name.into(), found, want))
        };
        match (open.last().map(String::as_str), name) {
            (None, "VTKFile") => {
                if tag.get("type") != Some("UnstructuredGrid") {
                    return wrong("type", "UnstructuredGrid");
                }
                let big_endian = match tag.get("byte_order") {
                    None | Some("LittleEndian") => false,
                    Some("BigEndian") => true,
                    _ => return wrong("byte_order", "LittleEndian or BigEndian"),
                };
                let header = match tag.get("header_type") {
                    None | Some("UInt32") => 4,
                    Some("UInt64") => 8,
                    _ => return wrong("header_type", "UInt32 or UInt64"),
                };
                (self.layout.big_endian, self.layout.header) = (big_endian, header);
                self.layout.compressor = tag.get("compressor").unwrap_or_default().into();
            }
            (None, _) => {
                return Err(self.layout.syntax("start".into(), format!("<{name}>"), "<VTKFile>"));
            }
            (Some("UnstructuredGrid"), "Piece") => {
                let count = |what| tag.get(what).and_then(|n| n.trim().parse().ok());
                let Some(points) = count("NumberOfPoints") else {
                    return wrong("NumberOfPoints", "a count");
                };
                let Some(cells) = count("NumberOfCells") else {
                    return wrong("NumberOfCells", "a count");
                };
                self.pieces.push(Piece { points, cells, arrays: Vec::new() });
            }
            (Some(parent), "DataArray" | "Array") => {
                let array = Array::new(&self.layout, tag)?;
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
