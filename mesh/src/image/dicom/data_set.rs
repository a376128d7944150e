//! The values of a data set's elements.

use std::path::Path;

use super::cursor::{Cursor, Element};
use super::error::DicomError;
use super::tag::{PIXELS, Tag};

/// Characters of a value that a message shows.
const SHOWN: usize = 80;

/// The elements of a data set or of an item, up to and with the pixel data.
#[derive(Debug, Clone)]
pub(super) struct DataSet<'a> {
    cursor: Cursor<'a>,
    elements: Vec<Element<'a>>,
}

impl<'a> DataSet<'a> {
    /// All elements from the cursor on. Cost: O(bytes), those of the pixel data not looked at.
    pub fn read(mut cursor: Cursor<'a>) -> Result<Self, DicomError> {
        let mut elements = Vec::new();
        // What follows the pixels is padding and signatures.
        while !cursor.done() && elements.last().is_none_or(|e: &Element| e.tag != PIXELS.number) {
            elements.push(cursor.element(0)?);
        }
        Ok(Self { cursor, elements })
    }

    pub fn path(&self) -> &'a Path {
        self.cursor.path
    }

    /// The element, unless it is missing or empty.
    pub fn get(&self, tag: Tag) -> Option<&Element<'a>> {
        self.elements.iter().find(|e| e.tag == tag.number && !e.bytes.is_empty())
    }

    pub fn require(&self, tag: Tag) -> Result<&Element<'a>, DicomError> {
        let missing = || DicomError::MissingTag { path: self.path().into(), tag: tag.to_string() };
        self.get(tag).ok_or_else(missing)
    }

    pub fn refuse(&self, tag: Tag, value: impl ToString, want: &'static str) -> DicomError {
        let (path, value) = (self.path().into(), value.to_string());
        DicomError::Tag { path, tag: tag.to_string(), value, want }
    }

    /// The value as text without padding, or "" where there is none; made fit for a message.
    pub fn text(&self, tag: Tag) -> String {
        let bytes = self.get(tag).map_or(&[][..], |element| element.bytes);
        shown(bytes)
    }

    /// The one unsigned 16-bit number.
    pub fn u16(&self, tag: Tag) -> Result<Option<u16>, DicomError> {
        let Some(element) = self.get(tag) else { return Ok(None) };
        match <[u8; 2]>::try_from(element.bytes) {
            Ok(bytes) => Ok(Some(element.encoding.u16(bytes))),
            Err(_) => {
                let value = format!("{} bytes long", element.bytes.len());
                Err(self.refuse(tag, value, "one unsigned number of 2 bytes"))
            }
        }
    }

    pub fn required_u16(&self, tag: Tag) -> Result<u16, DicomError> {
        self.require(tag)?;
        Ok(self.u16(tag)?.unwrap_or_default())
    }

    /// N finite numbers in decimal.
    pub fn numbers<const N: usize>(
        &self,
        tag: Tag,
        want: &'static str,
    ) -> Result<Option<[f64; N]>, DicomError> {
        let Some(element) = self.get(tag) else { return Ok(None) };
        let refuse = || self.refuse(tag, format!("\"{}\"", shown(element.bytes)), want);
        let text = str::from_utf8(element.bytes).map_err(|_| refuse())?;
        let mut words = text.split('\\');
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            let word = words.next().unwrap_or_default().trim_matches([' ', '\0']);
            let value: f64 = word.parse().map_err(|_| refuse())?;
            if !value.is_finite() {
                return Err(refuse());
            }
            *number = value;
        }
        if words.next().is_some() { Err(refuse()) } else { Ok(Some(numbers)) }
    }

    /// The items of a sequence, none where it is missing.
    pub fn items(&self, tag: Tag) -> Result<Vec<DataSet<'a>>, DicomError> {
        let Some(element) = self.get(tag) else { return Ok(vec![]) };
        let mut cursor = self.cursor.within(element);
        let mut items = Vec::new();
        while !cursor.done() {
            let (at, bytes) = cursor.item(tag.number, 0)?;
            let end = at + bytes.len();
            items.push(DataSet::read(Cursor { at, end, ..cursor.clone() })?);
        }
        Ok(items)
    }

    /// The fragments of encapsulated pixel data, the first of which is the offset table.
    pub fn fragments(&self, pixels: &Element<'a>) -> Result<Vec<&'a [u8]>, DicomError> {
        let mut cursor = self.cursor.within(pixels);
        let mut fragments = Vec::new();
        while !cursor.done() {
            fragments.push(cursor.item(PIXELS.number, 0)?.1);
        }
        Ok(fragments)
    }
}

/// Bytes as text without padding, escaped and cut to what a message holds.
pub(super) fn shown(bytes: &[u8]) -> String {
    let padding = |byte: &u8| *byte == b' ' || *byte == 0;
    let start = bytes.iter().position(|byte| !padding(byte)).unwrap_or(bytes.len());
    let end = bytes.iter().rposition(|byte| !padding(byte)).map_or(start, |last| last + 1);
    // A backslash parts values; escaping it would double it.
    let text = String::from_utf8_lossy(&bytes[start..end]);
    text.chars().take(SHOWN).map(|c| if c.is_control() { '?' } else { c }).collect()
}
