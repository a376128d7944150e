//! Data arrays of VTK XML files: text, base64 or raw; plain or in zlib blocks.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;

use crate::image::voxels::{Sample, each_voxel_type};
use crate::image::{VoxelType, Voxels};
use crate::tet_file::TetMeshError;

/// Deflate shrinks to a 1032nd at best (zlib's technical details).
const BEST_RATIO: u64 = 1032;

/// What the root element and the appended data say.
#[derive(Default)]
pub(crate) struct Layout<'a> {
    pub(crate) big_endian: bool,
    /// Bytes of the counts before binary data, 4 or 8.
    pub(crate) header: usize,
    pub(crate) compressor: String,
    /// Whether appended data are base64.
    pub(crate) base64: bool,
    /// What follows the underscore of the appended data.
    pub(crate) appended: &'a [u8],
}

/// Attributes of an element, in any order.
#[derive(Default)]
pub(crate) struct Attributes(Vec<(String, String)>);

impl Attributes {
    pub(crate) fn read(place: &str, tag: &BytesStart) -> Result<Self, TetMeshError> {
        let wrong =
            |reason: String| TetMeshError::syntax(place, reason, "attributes as name=\"value\"");
        let mut list = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|error| wrong(error.to_string()))?;
            let value = attribute.normalized_value(XmlVersion::Implicit1_0);
            let value = value.map_err(|error| wrong(error.to_string()))?;
            list.push((attribute.key.as_ref().to_string(), value.into_owned()));
        }
        Ok(Self(list))
    }

    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// An error about an attribute of the element at `place`.
    pub(crate) fn wrong(&self, place: &str, name: &str, want: &str) -> TetMeshError {
        let found = format!("{name} {:?}", self.get(name).unwrap_or("missing"));
        TetMeshError::syntax(place, found, want)
    }
}

/// An array that is not yet decoded.
pub(crate) struct Array {
    pub(crate) name: String,
    /// `None` for strings and bits, which nobody needs.
    kind: Option<VoxelType>,
    pub(crate) components: u64,
    format: Format,
    /// Content of the element, if it is not appended.
    pub(crate) text: Vec<u8>,
}

enum Format {
    Ascii,
    Binary,
    Appended(u64),
}

impl Array {
    pub(crate) fn new(tag: &Attributes) -> Result<Self, TetMeshError> {
        let name = tag.get("Name").unwrap_or_default().to_string();
        let wrong = |what, want| tag.wrong(&format!("array {name:?}"), what, want);
        let kind = match tag.get("type") {
            Some("Int8") => Some(VoxelType::I8),
            Some("Int16") => Some(VoxelType::I16),
            Some("Int32") => Some(VoxelType::I32),
            Some("Int64") => Some(VoxelType::I64),
            Some("UInt8") => Some(VoxelType::U8),
            Some("UInt16") => Some(VoxelType::U16),
            Some("UInt32") => Some(VoxelType::U32),
            Some("UInt64") => Some(VoxelType::U64),
            Some("Float32") => Some(VoxelType::F32),
            Some("Float64") => Some(VoxelType::F64),
            _ => None,
        };
        let components = tag.get("NumberOfComponents").unwrap_or("1").parse();
        let components = components.map_err(|_| wrong("NumberOfComponents", "a count"))?;
        let format = match tag.get("format") {
            None | Some("ascii") => Format::Ascii,
            Some("binary") => Format::Binary,
            Some("appended") => {
                let offset = tag.get("offset").unwrap_or("0").parse();
                Format::Appended(offset.map_err(|_| wrong("offset", "a number of bytes"))?)
            }
            _ => return Err(wrong("format", "ascii, binary or appended")),
        };
        Ok(Self { name, kind, components, format, text: Vec::new() })
    }

    /// Exactly `count` real numbers.
    pub(crate) fn reals(&self, layout: &Layout, count: u64) -> Result<Vec<f64>, TetMeshError> {
        Ok(each_voxel_type!(self.numbers(layout, count)?, numbers => {
            numbers.into_iter().map(|number| Sample::from(number).value()).collect()
        }))
    }

    /// Exactly `count` integers, which must be what `want` says.
    pub(crate) fn integers(
        &self,
        layout: &Layout,
        count: u64,
        want: &str,
    ) -> Result<Vec<i64>, TetMeshError> {
        let exact = |number: Sample| {
            number.label().ok_or_else(|| self.wrong(number.value().to_string(), want))
        };
        each_voxel_type!(self.numbers(layout, count)?, numbers => {
            numbers.into_iter().map(|number| exact(number.into())).collect()
        })
    }

    pub(crate) fn wrong(&self, found: impl AsRef<str>, want: impl Into<String>) -> TetMeshError {
        TetMeshError::syntax(self.place(), found, want)
    }

    fn place(&self) -> String {
        format!("array {:?}", self.name)
    }

    fn claim(&self, claimed: u64, limit: u64) -> TetMeshError {
        TetMeshError::Claim { place: self.place(), what: "numbers", claimed, limit }
    }

    /// Exactly `count` numbers as they are stored; those written as text in the widest type.
    pub(crate) fn numbers(&self, layout: &Layout, count: u64) -> Result<Voxels, TetMeshError> {
        let Some(kind) = self.kind else {
            let advice = "use Int8 to UInt64, Float32 or Float64";
            return Err(TetMeshError::unsupported(&self.place(), "its type", advice));
        };
        let (source, base64) = match self.format {
            Format::Ascii => return self.ascii(kind, count),
            Format::Binary => (self.text.as_slice(), true),
            Format::Appended(offset) => {
                let start = usize::try_from(offset).ok();
                let source = start.and_then(|at| layout.appended.get(at..)).ok_or_else(|| {
                    let want = format!("at most {}, the appended bytes", layout.appended.len());
                    self.wrong(format!("offset {offset}"), want)
                })?;
                (source, layout.base64)
            }
        };
        let ratio = if layout.compressor.is_empty() { 1 } else { BEST_RATIO };
        let limit = (source.len() as u64).saturating_mul(ratio) / kind.bytes();
        if count > limit {
            return Err(self.claim(count, limit));
        }
        let mut source = Source { layout, array: self, left: source, base64 };
        let bytes = source.data((count * kind.bytes()) as usize)?;
        Ok(Voxels::decode(kind, layout.big_endian, &bytes))
    }

    /// Numbers as text, in the widest type: as many digits as there are.
    fn ascii(&self, kind: VoxelType, count: u64) -> Result<Voxels, TetMeshError> {
        let text = String::from_utf8_lossy(&self.text);
        let words = text.split_ascii_whitespace();
        let wrong = |word: &str| self.wrong(format!("{word:?}"), "numbers of the array's type");
        let numbers = if matches!(kind, VoxelType::F32 | VoxelType::F64) {
            let numbers = words.map(|word| word.parse().map_err(|_| wrong(word)));
            Voxels::F64(numbers.collect::<Result<_, _>>()?)
        } else {
            let numbers = words.map(|word| word.parse().map_err(|_| wrong(word)));
            Voxels::I64(numbers.collect::<Result<_, _>>()?)
        };
        if numbers.count() as u64 != count {
            let found = format!("{} numbers", numbers.count());
            return Err(self.wrong(found, count.to_string()));
        }
        Ok(numbers)
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
    /// The next `count` bytes; in base64, of a group of characters that starts here.
    fn take(&mut self, count: usize) -> Result<Vec<u8>, TetMeshError> {
        let short = |source: &Self| source.array.wrong("too few bytes", format!("{count} more"));
        if !self.base64 {
            let (bytes, left) = self.left.split_at_checked(count).ok_or_else(|| short(self))?;
            self.left = left;
            return Ok(bytes.to_vec());
        }
        let characters = count.div_ceil(3).checked_mul(4).ok_or_else(|| short(self))?;
        let mut rest = self.left.iter();
        let written = rest.by_ref().copied().filter(|byte| !byte.is_ascii_whitespace());
        let group: Vec<u8> = written.take(characters).collect();
        if group.len() < characters {
            return Err(short(self));
        }
        self.left = rest.as_slice();
        let mut bytes =
            STANDARD.decode(&group).map_err(|e| self.array.wrong(e.to_string(), "base64"))?;
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
                    let want = format!("{want}, by what the piece announces");
                    return Err(self.array.wrong(format!("{found} bytes"), want));
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
                let advice = "save it uncompressed or with zlib";
                Err(TetMeshError::unsupported(&self.array.place(), other, advice))
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
            return Err(self.array.claim(blocks as u64, limit));
        }
        let sizes = self.take(header * (3 + blocks))?;
        let sizes: Vec<usize> = sizes.chunks_exact(header).map(|size| self.count(size)).collect();
        let total = sizes[3..].iter().try_fold(0usize, |sum, &size| sum.checked_add(size));
        let total = total.filter(|&total| total <= self.left.len());
        let total = total.ok_or_else(|| self.array.wrong("too few bytes", "all zlib blocks"))?;
        let packed = self.take(total)?;
        let mut data = Vec::new();
        let mut at = 0;
        for &size in &sizes[3..] {
            let block = &packed[at..at + size];
            at += size;
            // One byte beyond what is wanted shows that there is too much.
            let room = (want - data.len()) as u64 + 1;
            let inflated = ZlibDecoder::new(block).take(room).read_to_end(&mut data);
            inflated
                .map_err(|e| self.array.wrong(format!("a damaged zlib block ({e})"), "zlib"))?;
            if data.len() > want {
                break;
            }
        }
        if data.len() == want {
            return Ok(data);
        }
        let want = format!("{want} bytes, by what the piece announces");
        Err(self.array.wrong(format!("{} bytes or more", data.len()), want))
    }
}
