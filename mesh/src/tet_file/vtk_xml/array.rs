//! Data arrays of .vtu files: text, base64 or raw; plain or in zlib blocks.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;

use super::layout::{Attributes, Layout};
use crate::tet_file::TetMeshError;

/// Deflate shrinks to a 1032nd at best (zlib's technical details).
const BEST_RATIO: u64 = 1032;

/// 2⁵³, the magnitude up to which every integer is an f64.
const EXACT_F64: f64 = 9_007_199_254_740_992.0;

/// An array that is not yet decoded.
pub(super) struct Array {
    pub(super) name: String,
    kind: Kind,
    pub(super) components: u64,
    format: Format,
    /// Content of the element, if it is not appended.
    pub(super) text: Vec<u8>,
}

#[derive(Clone, Copy)]
enum Kind {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
    /// Strings and bits, which no mesh needs.
    Other,
}

enum Format {
    Ascii,
    Binary,
    Appended(u64),
}

/// Decoded numbers.
pub(super) enum Numbers {
    Integers(Vec<i64>),
    Reals(Vec<f64>),
}

impl Numbers {
    pub(super) fn reals(self) -> Vec<f64> {
        match self {
            Self::Integers(values) => values.into_iter().map(|v| v as f64).collect(),
            Self::Reals(values) => values,
        }
    }

    /// The values as integers, or the first that is none.
    pub(super) fn integers(self) -> Result<Vec<i64>, f64> {
        match self {
            Self::Integers(values) => Ok(values),
            Self::Reals(values) => {
                // NaN and infinity fail the comparison.
                let exact = |v: f64| v.abs() <= EXACT_F64 && v.fract() == 0.0;
                values.into_iter().map(|v| if exact(v) { Ok(v as i64) } else { Err(v) }).collect()
            }
        }
    }
}

impl Array {
    pub(super) fn new(layout: &Layout, tag: &Attributes) -> Result<Self, TetMeshError> {
        let name = tag.get("Name").unwrap_or_default().to_string();
        let wrong = |what: &str, want: &str| {
            let found = format!("{what} {:?}", tag.get(what).unwrap_or("missing"));
            Err(layout.syntax(format!("array {name:?}"), found, want))
        };
        let kind = match tag.get("type") {
            Some("Int8") => Kind::Signed(1),
            Some("Int16") => Kind::Signed(2),
            Some("Int32") => Kind::Signed(4),
            Some("Int64") => Kind::Signed(8),
            Some("UInt8") => Kind::Unsigned(1),
            Some("UInt16") => Kind::Unsigned(2),
            Some("UInt32") => Kind::Unsigned(4),
            Some("UInt64") => Kind::Unsigned(8),
            Some("Float32") => Kind::Float(4),
            Some("Float64") => Kind::Float(8),
            _ => Kind::Other,
        };
        let Ok(components) = tag.get("NumberOfComponents").unwrap_or("1").parse() else {
            return wrong("NumberOfComponents", "a count");
        };
        let format = match tag.get("format") {
            None | Some("ascii") => Format::Ascii,
            Some("binary") => Format::Binary,
            Some("appended") => match tag.get("offset").unwrap_or("0").parse() {
                Ok(offset) => Format::Appended(offset),
                Err(_) => return wrong("offset", "a number of bytes"),
            },
            _ => return wrong("format", "ascii, binary or appended"),
        };
        Ok(Self { name, kind, components, format, text: Vec::new() })
    }

    pub(super) fn place(&self) -> String {
        format!("array {:?}", self.name)
    }

    /// Decodes exactly `count` numbers.
    pub(super) fn numbers(&self, layout: &Layout, count: u64) -> Result<Numbers, TetMeshError> {
        let width = match self.kind {
            Kind::Signed(width) | Kind::Unsigned(width) | Kind::Float(width) => width,
            Kind::Other => {
                let advice = "use Int8 to UInt64, Float32 or Float64";
                return Err(layout.unsupported(self.place(), "its type", advice));
            }
        };
        let (source, base64) = match self.format {
            Format::Ascii => return self.ascii(layout, count),
            Format::Binary => (self.text.as_slice(), true),
            Format::Appended(offset) => {
                let start = usize::try_from(offset).ok();
                let Some(source) = start.and_then(|at| layout.appended.get(at..)) else {
                    let limit = layout.appended.len();
                    let want = format!("at most {limit}, the appended bytes");
                    return Err(layout.syntax(self.place(), format!("offset {offset}"), want));
                };
                (source, layout.base64)
            }
        };
        let ratio = if layout.compressor.is_empty() { 1 } else { BEST_RATIO };
        let limit = (source.len() as u64).saturating_mul(ratio) / width as u64;
        if count > limit {
            return Err(layout.claim(self.place(), count, limit));
        }
        let mut bytes = Source { layout, array: self, left: source, base64 };
        let bytes = bytes.data(count as usize * width)?;
        self.convert(layout, &bytes, width)
    }

    fn ascii(&self, layout: &Layout, count: u64) -> Result<Numbers, TetMeshError> {
        let text = String::from_utf8_lossy(&self.text);
        let words = text.split_ascii_whitespace();
        let wrong = |word: &str| {
            layout.syntax(self.place(), format!("{word:?}"), "numbers of the array's type")
        };
        let numbers = if matches!(self.kind, Kind::Float(_)) {
            let values: Result<Vec<f64>, _> =
                words.map(|w| w.parse().map_err(|_| wrong(w))).collect();
            Numbers::Reals(values?)
        } else {
            let values: Result<Vec<i64>, _> =
                words.map(|w| w.parse().map_err(|_| wrong(w))).collect();
            Numbers::Integers(values?)
        };
        let found = match &numbers {
            Numbers::Integers(values) => values.len(),
            Numbers::Reals(values) => values.len(),
        };
        if found as u64 == count {
            return Ok(numbers);
        }
        Err(layout.syntax(self.place(), format!("{found} numbers"), count.to_string()))
    }

    fn convert(
        &self,
        layout: &Layout,
        bytes: &[u8],
        width: usize,
    ) -> Result<Numbers, TetMeshError> {
        let raw = |chunk: &[u8]| {
            let mut value = [0; 8];
            value[..width].copy_from_slice(chunk);
            if layout.big_endian {
                value[..width].reverse();
            }
            u64::from_le_bytes(value)
        };
        let chunks = bytes.chunks_exact(width).map(raw);
        Ok(match self.kind {
            Kind::Float(4) => {
                Numbers::Reals(chunks.map(|v| f32::from_bits(v as u32).into()).collect())
            }
            Kind::Float(_) => Numbers::Reals(chunks.map(f64::from_bits).collect()),
            Kind::Signed(width) => {
                // The sign bit moves to the top and back, which extends it.
                let shift = 64 - 8 * width as u32;
                Numbers::Integers(chunks.map(|v| ((v << shift) as i64) >> shift).collect())
            }
            _ => {
                let narrow = |v: u64| {
                    let want = "integers below 2^63";
                    i64::try_from(v).map_err(|_| layout.syntax(self.place(), v.to_string(), want))
                };
                Numbers::Integers(chunks.map(narrow).collect::<Result<_, _>>()?)
            }
        })
    }
}

/// The stored bytes of an array, from its start.
struct Source<'a> {
    layout: &'a Layout<'a>,
    array: &'a Array,
    left: &'a [u8],
    base64: bool,
}

impl Source<'_> {
    fn wrong(&self, found: String, want: impl Into<String>) -> TetMeshError {
        self.layout.syntax(self.array.place(), found, want)
    }

    /// The next `count` bytes; in base64, of a group of characters that starts here.
    fn take(&mut self, count: usize) -> Result<Vec<u8>, TetMeshError> {
        let short = |source: &Self| source.wrong("too few bytes".into(), format!("{count} more"));
        if !self.base64 {
            let (bytes, left) = self.left.split_at_checked(count).ok_or_else(|| short(self))?;
            self.left = left;
            return Ok(bytes.to_vec());
        }
        let characters = count.div_ceil(3).checked_mul(4).ok_or_else(|| short(self))?;
        let mut group = Vec::new();
        let mut used = 0;
        for &b in self.left {
            if group.len() == characters {
                break;
            }
            used += 1;
            if !b.is_ascii_whitespace() {
                group.push(b);
            }
        }
        if group.len() < characters {
            return Err(short(self));
        }
        self.left = &self.left[used..];
        let mut bytes = STANDARD.decode(&group).map_err(|e| self.wrong(e.to_string(), "base64"))?;
        if bytes.len() < count {
            return Err(short(self));
        }
        bytes.truncate(count);
        Ok(bytes)
    }

    fn count(&self, bytes: &[u8]) -> usize {
        let mut value = [0; 8];
        value[..bytes.len()].copy_from_slice(bytes);
        if self.layout.big_endian {
            value[..bytes.len()].reverse();
        }
        // More than usize is more than any file holds.
        usize::try_from(u64::from_le_bytes(value)).unwrap_or(usize::MAX)
    }

    /// Exactly `want` bytes of data.
    fn data(&mut self, want: usize) -> Result<Vec<u8>, TetMeshError> {
        let header = self.layout.header;
        match self.layout.compressor.as_str() {
            "" => {
                let start = self.left;
                let announced = self.take(header)?;
                let found = self.count(&announced);
                if found != want {
                    let want = format!("{want}, by the counts of the piece");
                    return Err(self.wrong(format!("{found} bytes"), want));
                }
                // Header and data are one base64 stream, or each its own: padding tells.
                if self.base64 && !self.padded(start) {
                    self.left = start;
                    return Ok(self.take(header + want)?.split_off(header));
                }
                self.take(want)
            }
            "vtkZLibDataCompressor" => self.blocks(want),
            other => {
                let advice = "save the mesh uncompressed or with zlib";
                Err(self.layout.unsupported(self.array.place(), other, advice))
            }
        }
    }

    /// Whether the group of characters just taken from `start` ends in padding.
    fn padded(&self, start: &[u8]) -> bool {
        let taken = &start[..start.len() - self.left.len()];
        taken.iter().rfind(|b| !b.is_ascii_whitespace()) == Some(&b'=')
    }

    /// Compressed data: number of blocks, size of a block, size of the last one if it is partial,
    /// compressed sizes; then the blocks.
    fn blocks(&mut self, want: usize) -> Result<Vec<u8>, TetMeshError> {
        let header = self.layout.header;
        let start = self.left;
        let blocks = self.take(header)?;
        let blocks = self.count(&blocks);
        if (blocks, want) == (0, 0) {
            return Ok(Vec::new());
        }
        self.left = start;
        if blocks > self.left.len() / header {
            let limit = (self.left.len() / header) as u64;
            return Err(self.layout.claim(self.array.place(), blocks as u64, limit));
        }
        let sizes = self.take(header * (3 + blocks))?;
        let sizes: Vec<usize> = sizes.chunks_exact(header).map(|size| self.count(size)).collect();
        let total = sizes[3..].iter().try_fold(0usize, |sum, &size| sum.checked_add(size));
        let total = total.filter(|&total| total <= self.left.len());
        let total = total.ok_or_else(|| self.wrong("too few bytes".into(), "all zlib blocks"))?;
        let packed = self.take(total)?;
        let mut data = Vec::new();
        let mut at = 0;
        for &size in &sizes[3..] {
            let block = &packed[at..at + size];
            at += size;
            // One byte beyond what is wanted shows that there is too much.
            let room = (want - data.len()) as u64 + 1;
            let inflated = ZlibDecoder::new(block).take(room).read_to_end(&mut data);
            inflated.map_err(|e| self.wrong(format!("a damaged zlib block ({e})"), "zlib"))?;
            if data.len() > want {
                break;
            }
        }
        if data.len() == want {
            return Ok(data);
        }
        let want = format!("{want} bytes, by the counts of the piece");
        Err(self.wrong(format!("{} bytes or more", data.len()), want))
    }
}
