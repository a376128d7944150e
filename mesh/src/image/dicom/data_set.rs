//! The values of a data set's elements.

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

    /// The element, unless it is missing or empty.
    pub fn get(&self, tag: Tag) -> Option<&Element<'a>> {
        self.elements.iter().find(|e| e.tag == tag.number && !e.bytes.is_empty())
    }

    pub fn require(&self, tag: Tag) -> Result<&Element<'a>, DicomError> {
        self.get(tag).ok_or_else(|| DicomError::MissingTag(tag.to_string()))
    }

    /// The value as text without padding, or "" where there is none; made fit for a message.
    pub fn text(&self, tag: Tag) -> String {
        self.get(tag).map_or(String::new(), |element| shown(element.bytes))
    }

    /// The one unsigned 16-bit number.
    pub fn u16(&self, tag: Tag) -> Result<Option<u16>, DicomError> {
        let Some(element) = self.get(tag) else { return Ok(None) };
        let bytes = <[u8; 2]>::try_from(element.bytes).map_err(|_| {
            let value = format!("{} bytes long", element.bytes.len());
            tag.refuse(value, "one unsigned number of 2 bytes")
        })?;
        Ok(Some(element.encoding.u16(bytes)))
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
        let refuse = || tag.refuse(format!("\"{}\"", shown(element.bytes)), want);
        let text = str::from_utf8(element.bytes).map_err(|_| refuse())?;
        let numbers: Option<Vec<f64>> = text
            .split('\\')
            .take(N + 1)
            .map(|word| word.trim_matches([' ', '\0']).parse().ok())
            .collect();
        let numbers = numbers.filter(|numbers| numbers.iter().all(|x| x.is_finite()));
        let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
        numbers.map(Some).ok_or_else(refuse)
    }

    /// As [`Self::numbers`], of an element that must be there.
    pub fn required<const N: usize>(
        &self,
        tag: Tag,
        want: &'static str,
    ) -> Result<[f64; N], DicomError> {
        self.require(tag)?;
        Ok(self.numbers(tag, want)?.unwrap_or([0.0; N]))
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
