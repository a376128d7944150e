//! A DICOM file: preamble, file meta group, and the data set in its transfer syntax.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use flate2::read::DeflateDecoder;

use super::cursor::{Cursor, EXPLICIT_LITTLE, Encoding, IMPLICIT_LITTLE};
use super::data_set::{DataSet, shown};
use super::error::DicomError;
use super::tag::{STORAGE_CLASS, TRANSFER_SYNTAX};
use crate::image::ImageError;

/// The preamble and the magic after it.
const PREAMBLE: usize = 132;

/// Bytes that a deflated data set may inflate to: one file of a series is far smaller.
const MAX_INFLATED: u64 = 1 << 30;

/// How pixels are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Codec {
    Raw,
    Rle,
    Jpeg,
    Jpeg2000,
    /// Only the data set around the pixels is.
    Unread {
        name: &'static str,
    },
}

/// A file in memory.
pub(super) struct DicomFile {
    path: PathBuf,
    /// The file, or the inflated data set alone.
    bytes: Vec<u8>,
    /// Where the data set starts.
    start: usize,
    encoding: Encoding,
    pub codec: Codec,
    /// MediaStorageSOPClassUID of the meta group, or "".
    pub storage_class: String,
    syntax: String,
}

impl DicomFile {
    /// Reads a file whole; `None` if it does not start as a DICOM file does.
    ///
    /// Only the start of other files is read.
    pub fn open(path: &Path) -> Result<Option<Self>, ImageError> {
        let io_error = |source| ImageError::Io { path: path.into(), source };
        let metadata = fs::metadata(path).map_err(io_error)?;
        if !metadata.is_file() {
            return Err(ImageError::NotAFile { path: path.into(), found: "no regular file" });
        }
        let mut file = File::open(path).map_err(io_error)?;
        let mut bytes = Vec::new();
        file.by_ref().take(PREAMBLE as u64).read_to_end(&mut bytes).map_err(io_error)?;
        if bytes.get(128..) != Some(b"DICM") {
            return Ok(None);
        }
        file.read_to_end(&mut bytes).map_err(io_error)?;
        Ok(Some(Self::parse(path, bytes)?))
    }

    /// As [`Self::open`], for a file that must be DICOM.
    pub fn require(path: &Path) -> Result<Self, ImageError> {
        if let Some(file) = Self::open(path)? {
            return Ok(file);
        }
        let mut start = Vec::new();
        if let Ok(file) = File::open(path) {
            file.take(PREAMBLE as u64).read_to_end(&mut start).ok();
        }
        let found = match start.get(128..) {
            Some(bytes) => format!("\"{}\"", bytes.escape_ascii()),
            None => format!("missing ({} bytes in all)", start.len()),
        };
        Err(DicomError::NotDicom { path: path.into(), found }.into())
    }

    fn parse(path: &Path, bytes: Vec<u8>) -> Result<Self, DicomError> {
        let Meta { end, storage_class, syntax } = meta(path, &bytes)?;
        let (encoding, codec, deflated) = transfer_syntax(path, &syntax)?;
        let (bytes, start) =
            if deflated { (inflate(path, &bytes[end..])?, 0) } else { (bytes, end) };
        Ok(Self { path: path.into(), bytes, start, encoding, codec, storage_class, syntax })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Refuses pixels that are not decoded.
    pub fn check_codec(&self) -> Result<(), DicomError> {
        match self.codec {
            Codec::Unread { name } => Err(unread(&self.path, &self.syntax, name)),
            _ => Ok(()),
        }
    }

    /// The elements, the structure of which is checked.
    pub fn data_set(&self) -> Result<DataSet<'_>, DicomError> {
        DataSet::read(Cursor {
            path: &self.path,
            all: &self.bytes,
            at: self.start,
            end: self.bytes.len(),
            encoding: self.encoding,
        })
    }
}

/// What the file meta group says.
struct Meta {
    end: usize,
    storage_class: String,
    syntax: String,
}

fn meta(path: &Path, all: &[u8]) -> Result<Meta, DicomError> {
    let end = all.len();
    let mut cursor = Cursor { path, all, at: PREAMBLE, end, encoding: EXPLICIT_LITTLE };
    let (mut syntax, mut storage_class, mut group_end) = (None, String::new(), usize::MAX);
    // A deflated data set could start like an element of the group: the group's length ends it.
    while cursor.at < group_end && !cursor.done() && cursor.peek()? >> 16 == 2 {
        let element = cursor.element(0)?;
        match (element.tag, <[u8; 4]>::try_from(element.bytes)) {
            (0x0002_0000, Ok(length)) => {
                group_end = cursor.at.saturating_add(u32::from_le_bytes(length) as usize);
            }
            (tag, _) if tag == TRANSFER_SYNTAX.number => syntax = Some(shown(element.bytes)),
            (tag, _) if tag == STORAGE_CLASS.number => storage_class = shown(element.bytes),
            _ => {}
        }
    }
    let missing = || DicomError::MissingTag { path: path.into(), tag: TRANSFER_SYNTAX.to_string() };
    Ok(Meta { end: cursor.at, storage_class, syntax: syntax.ok_or_else(missing)? })
}

/// Encoding, codec of the pixels, and whether the data set is deflated.
fn transfer_syntax(path: &Path, uid: &str) -> Result<(Encoding, Codec, bool), DicomError> {
    const PREFIX: &str = "1.2.840.10008.1.2";
    let big = Encoding { explicit: true, big_endian: true };
    let number = uid.strip_prefix(PREFIX).unwrap_or("unknown");
    let codec = match number {
        "" => return Ok((IMPLICIT_LITTLE, Codec::Raw, false)),
        ".2" => return Ok((big, Codec::Raw, false)),
        ".1.99" => return Ok((EXPLICIT_LITTLE, Codec::Raw, true)),
        ".1" => Codec::Raw,
        ".5" => Codec::Rle,
        ".4.50" | ".4.51" | ".4.57" | ".4.70" => Codec::Jpeg,
        ".4.90" | ".4.91" => Codec::Jpeg2000,
        ".1.98" => Codec::Unread { name: "encapsulated uncompressed" },
        ".4.80" | ".4.81" => Codec::Unread { name: "JPEG-LS" },
        ".4.92" | ".4.93" => Codec::Unread { name: "JPEG 2000 of several components" },
        ".4.110" | ".4.111" | ".4.112" => Codec::Unread { name: "JPEG XL" },
        ".4.201" | ".4.202" | ".4.203" => Codec::Unread { name: "High-Throughput JPEG 2000" },
        video if video.starts_with(".4.10") => Codec::Unread { name: "video" },
        _ => return Err(unread(path, uid, "unknown")),
    };
    Ok((EXPLICIT_LITTLE, codec, false))
}

fn unread(path: &Path, uid: &str, name: &'static str) -> DicomError {
    let advice = "decompress the series first (gdcmconv --raw IN OUT)";
    DicomError::TransferSyntax { path: path.into(), uid: uid.into(), name, advice }
}

fn inflate(path: &Path, deflated: &[u8]) -> Result<Vec<u8>, DicomError> {
    let mut bytes = Vec::new();
    let refuse = |found, want| DicomError::Deflated { path: path.into(), found, want };
    DeflateDecoder::new(deflated)
        .take(MAX_INFLATED + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| refuse(source.to_string(), "a whole deflate stream"))?;
    if bytes.len() as u64 > MAX_INFLATED {
        return Err(refuse(format!("over {MAX_INFLATED} bytes"), "at most 1 GiB per file"));
    }
    Ok(bytes)
}
