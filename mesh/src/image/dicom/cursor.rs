//! The structure of a data set: elements, sequences and items, each length checked against the
//! bytes that are left before anything is made of it.

use super::error::DicomError;
use super::tag::named;

/// A length that stands for "up to the delimiter".
const UNDEFINED: u32 = u32::MAX;

/// Items that may be nested in one another; images use four. Bounds the stack.
const MAX_DEPTH: usize = 32;

const ITEM: u32 = 0xfffe_e000;
const ITEM_END: u32 = 0xfffe_e00d;
const SEQUENCE_END: u32 = 0xfffe_e0dd;

/// Value representations whose length takes four bytes after two reserved ones.
const LONG: [&[u8; 2]; 13] =
    [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"];

/// How numbers and elements are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Encoding {
    /// Elements name their value representation.
    pub explicit: bool,
    pub big_endian: bool,
}

/// What data sets are written in unless the transfer syntax says otherwise.
pub(super) const EXPLICIT_LITTLE: Encoding = Encoding { explicit: true, big_endian: false };
pub(super) const IMPLICIT_LITTLE: Encoding = Encoding { explicit: false, big_endian: false };

impl Encoding {
    pub fn u16(self, bytes: [u8; 2]) -> u16 {
        if self.big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) }
    }

    pub fn u32(self, bytes: [u8; 4]) -> u32 {
        if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
    }
}

/// One element, its value not yet looked at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element<'a> {
    pub tag: u32,
    /// Value representation; blank where the encoding leaves it out.
    pub vr: [u8; 2],
    /// Where the value starts.
    pub start: usize,
    /// The value; of a sequence its items without the delimiter.
    pub bytes: &'a [u8],
    /// Whether it was a sequence up to a delimiter.
    pub delimited: bool,
    pub encoding: Encoding,
}

/// A place in the bytes of a file.
#[derive(Debug, Clone)]
pub(super) struct Cursor<'a> {
    /// The file, or the inflated data set.
    pub all: &'a [u8],
    pub at: usize,
    pub end: usize,
    pub encoding: Encoding,
}

impl<'a> Cursor<'a> {
    /// A cursor over the items of a sequence.
    pub fn within(&self, element: &Element) -> Self {
        let (start, encoding) = (element.start, element.encoding);
        Self { at: start, end: start + element.bytes.len(), encoding, ..self.clone() }
    }

    pub fn done(&self) -> bool {
        self.at >= self.end
    }

    fn take(&mut self, count: usize, tag: Option<u32>) -> Result<&'a [u8], DicomError> {
        let left = self.end - self.at;
        if count > left {
            let place = tag.map_or("an element's head".into(), named);
            let found = format!("{count} bytes announced, {left} left");
            return Err(broken(self.at, place, found, "no more bytes than are left"));
        }
        let bytes = &self.all[self.at..self.at + count];
        self.at += count;
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self, tag: Option<u32>) -> Result<[u8; N], DicomError> {
        let bytes = self.take(N, tag)?;
        Ok(std::array::from_fn(|i| bytes[i]))
    }

    fn tag(&mut self) -> Result<u32, DicomError> {
        let [a, b, c, d] = self.array(None)?;
        let (group, element) = (self.encoding.u16([a, b]), self.encoding.u16([c, d]));
        Ok(u32::from(group) << 16 | u32::from(element))
    }

    fn length(&mut self, tag: u32) -> Result<u32, DicomError> {
        let bytes = self.array(Some(tag))?;
        Ok(self.encoding.u32(bytes))
    }

    /// The next element's number, which stays unread.
    pub fn peek(&self) -> Result<u32, DicomError> {
        self.clone().tag()
    }

    /// The next element; a sequence is passed over, its items' heads checked.
    pub fn element(&mut self, depth: usize) -> Result<Element<'a>, DicomError> {
        let offset = self.at;
        let tag = self.tag()?;
        if tag >> 16 == 0xfffe {
            let want = "an element of a data set";
            return Err(broken(offset, named(tag), "a stray delimiter".into(), want));
        }
        let (vr, length) = self.representation(tag)?;
        let (start, delimited) = (self.at, length == UNDEFINED);
        // Unknown elements of undefined length are sequences in implicit little endian.
        let encoding = if delimited && &vr == b"UN" { IMPLICIT_LITTLE } else { self.encoding };
        let bytes = if delimited {
            let outer = std::mem::replace(&mut self.encoding, encoding);
            let end = self.pass_items(tag, depth + 1)?;
            self.encoding = outer;
            &self.all[start..end]
        } else {
            self.take(length as usize, Some(tag))?
        };
        Ok(Element { tag, vr, start, bytes, delimited, encoding })
    }

    fn representation(&mut self, tag: u32) -> Result<([u8; 2], u32), DicomError> {
        if !self.encoding.explicit {
            return Ok((*b"  ", self.length(tag)?));
        }
        let offset = self.at;
        let vr: [u8; 2] = self.array(Some(tag))?;
        if !vr.iter().all(u8::is_ascii_uppercase) {
            let found = format!("value representation \"{}\"", vr.escape_ascii());
            return Err(broken(offset, named(tag), found, "two capital letters"));
        }
        if LONG.contains(&&vr) {
            self.take(2, Some(tag))?;
            return Ok((vr, self.length(tag)?));
        }
        let length = self.array(Some(tag))?;
        Ok((vr, self.encoding.u16(length).into()))
    }

    /// Passes over the items of `sequence` and its delimiter; where that one starts.
    fn pass_items(&mut self, sequence: u32, depth: usize) -> Result<usize, DicomError> {
        if depth > MAX_DEPTH {
            let found = format!("items {depth} deep in one another");
            return Err(broken(self.at, named(sequence), found, "at most 32"));
        }
        loop {
            let offset = self.at;
            if self.peek()? == SEQUENCE_END {
                self.take(8, Some(sequence))?;
                return Ok(offset);
            }
            self.item(sequence, depth)?;
        }
    }

    /// The bytes of the next item of `sequence`, and where they start.
    pub fn item(&mut self, sequence: u32, depth: usize) -> Result<(usize, &'a [u8]), DicomError> {
        let offset = self.at;
        let tag = self.tag()?;
        if tag != ITEM {
            let want = "an item (FFFE,E000) or the end (FFFE,E0DD) of the sequence";
            return Err(broken(offset, named(sequence), named(tag), want));
        }
        let length = self.length(sequence)?;
        let start = self.at;
        if length != UNDEFINED {
            return Ok((start, self.take(length as usize, Some(sequence))?));
        }
        loop {
            let end = self.at;
            if self.peek()? == ITEM_END {
                self.take(8, Some(sequence))?;
                return Ok((start, &self.all[start..end]));
            }
            self.element(depth)?;
        }
    }
}

fn broken(offset: usize, place: String, found: String, want: &'static str) -> DicomError {
    DicomError::Structure { offset, place, found, want }
}
