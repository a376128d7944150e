//! The elements of a .vtu file: pieces, their arrays, and the block of appended data.

use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::array::Array;
use crate::tet_file::TetMeshError;
use crate::tet_file::file::shortened;

/// A .vtu file, its arrays not yet decoded.
pub(super) struct Document<'a> {
    path: &'a Path,
    pub(super) big_endian: bool,
    /// Bytes of the counts before binary data, 4 or 8.
    pub(super) header: usize,
    pub(super) compressor: String,
    /// Whether appended data are base64.
    pub(super) base64: bool,
    /// What follows the underscore of the appended data.
    pub(super) appended: &'a [u8],
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
    pub(super) fn points(&self, document: &Document) -> Result<&Array, TetMeshError> {
        let points = self.arrays.iter().find(|(parent, _)| parent == "Points");
        let missing = || document.syntax("Piece".into(), "no Points".into(), "an array of points");
        points.map(|(_, array)| array).ok_or_else(missing)
    }

    pub(super) fn topology(&self, document: &Document, name: &str) -> Result<&Array, TetMeshError> {
        self.find("Cells", name).ok_or_else(|| {
            document.syntax(
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
        let mut document = Self {
            path,
            big_endian: false,
            header: 4,
            compressor: String::new(),
            base64: true,
            appended: &[],
            pieces: Vec::new(),
        };
        // Raw appended data are no XML: what comes before is read on its own.
        let cut = find(bytes, b"<AppendedData").unwrap_or(bytes.len());
        if let Some(length) = find(&bytes[cut..], b"</AppendedData>") {
            document.append(&bytes[cut..cut + length])?;
        } else if cut < bytes.len() {
            let found = "the end of the file".into();
            return Err(document.syntax("AppendedData".into(), found, "</AppendedData>"));
        }
        let closed = document.elements(&bytes[..cut])?;
        if !closed && cut == bytes.len() {
            let place = format!("byte {}", bytes.len());
            return Err(document.syntax(place, "the end of the file".into(), "</VTKFile>"));
        }
        Ok(document)
    }

    pub(super) fn syntax(
        &self,
        place: String,
        found: String,
        want: impl Into<String>,
    ) -> TetMeshError {
        let (place, found) = (shortened(&place), shortened(&found));
        TetMeshError::Syntax { path: self.path.into(), place, found, want: want.into() }
    }

    pub(super) fn unsupported(
        &self,
        place: String,
        found: &str,
        advice: &'static str,
    ) -> TetMeshError {
        let (place, found) = (shortened(&place), shortened(found));
        TetMeshError::Unsupported { path: self.path.into(), place, found, advice }
    }

    pub(super) fn claim(&self, place: String, claimed: u64, limit: u64) -> TetMeshError {
        let (what, place) = ("numbers", shortened(&place));
        TetMeshError::Claim { path: self.path.into(), place, what, claimed, limit }
    }

    /// The element `<AppendedData encoding="…">_…`, without its end.
    fn append(&mut self, element: &'a [u8]) -> Result<(), TetMeshError> {
        let wrong = |found: &str| {
            self.syntax(
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
        (self.base64, self.appended) = (base64, &element[start + 1..]);
        Ok(())
    }

    /// Collects pieces and arrays; true if the root element is closed.
    fn elements(&mut self, xml: &[u8]) -> Result<bool, TetMeshError> {
        let mut reader = Reader::from_reader(xml);
        reader.expand_empty_elements(true);
        let (mut open, mut buffer): (Vec<String>, _) = (Vec::new(), Vec::new());
        loop {
            buffer.clear();
            let event = reader.read_event(&mut buffer);
            let place = format!("byte {}", reader.buffer_position());
            match event.map_err(|e| self.syntax(place.clone(), e.to_string(), "XML"))? {
                Event::Start(tag) => {
                    let name = String::from_utf8_lossy(tag.name()).into_owned();
                    self.start(&open, &name, &Attributes::read(self, &place, &tag)?)?;
                    open.push(name);
                }
                Event::Text(text) if open.last().is_some_and(|name| name == "DataArray") => {
                    if let Some((_, array)) =
                        self.pieces.last_mut().and_then(|p| p.arrays.last_mut())
                    {
                        array.text.extend_from_slice(text.escaped());
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
            Err(self.syntax(name.into(), found, want))
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
                (self.big_endian, self.header) = (big_endian, header);
                self.compressor = tag.get("compressor").unwrap_or_default().into();
            }
            (None, _) => {
                return Err(self.syntax("start".into(), format!("<{name}>"), "<VTKFile>"));
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
                let array = Array::new(self, tag)?;
                if let Some(piece) = self.pieces.last_mut() {
                    piece.arrays.push((parent.to_string(), array));
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Attributes of an element, in any order.
pub(super) struct Attributes(Vec<(String, String)>);

impl Attributes {
    fn read(document: &Document, place: &str, tag: &BytesStart) -> Result<Self, TetMeshError> {
        let wrong = |e: quick_xml::Error| {
            document.syntax(place.into(), e.to_string(), "attributes as name=\"value\"")
        };
        let mut list = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(wrong)?;
            let value = attribute.unescaped_value().map_err(wrong)?;
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            list.push((text(attribute.key), text(&value)));
        }
        Ok(Self(list))
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

fn find(bytes: &[u8], pattern: &[u8]) -> Option<usize> {
    bytes.windows(pattern.len()).position(|window| window == pattern)
}
