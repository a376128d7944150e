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
    /// Only the data set around the pixels is read.
    Unread(&'static str),
}

impl Codec {
    pub fn name(self) -> &'static str {
        match self {
            Self::Raw => "uncompressed",
            Self::Rle => "RLE",
            Self::Jpeg => "JPEG",
            Self::Jpeg2000 => "JPEG 2000",
            Self::Unread(name) => name,
        }
    }
}

/// A file in memory.
pub(super) struct DicomFile {
    pub path: PathBuf,
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
    /// Reads a file whole; only its start if that is not as of a DICOM file.
    ///
    /// # Errors
    /// [`DicomError::NotDicom`] among others; all name the file.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        Self::read(path).map_err(ImageError::in_file(path))
    }

    fn read(path: &Path) -> Result<Self, ImageError> {
        if !fs::metadata(path)?.is_file() {
            return Err(ImageError::NotAFile("no regular file"));
        }
        let mut file = File::open(path)?;
        let mut bytes = Vec::new();
        file.by_ref().take(PREAMBLE as u64).read_to_end(&mut bytes)?;
        match bytes.get(128..) {
            Some(b"DICM") => file.read_to_end(&mut bytes)?,
            Some(other) => {
                let found = format!("\"{}\"", other.escape_ascii());
                return Err(DicomError::NotDicom(found).into());
            }
            None => {
                let found = format!("missing ({} bytes in all)", bytes.len());
                return Err(DicomError::NotDicom(found).into());
            }
        };
        let mut file = Self {
            path: path.into(),
            bytes,
            start: PREAMBLE,
            encoding: EXPLICIT_LITTLE,
            codec: Codec::Raw,
            storage_class: String::new(),
            syntax: String::new(),
        };
        file.read_meta()?;
        let deflated;
        (file.encoding, file.codec, deflated) = transfer_syntax(&file.syntax)?;
        if deflated {
            (file.bytes, file.start) = (inflate(&file.bytes[file.start..])?, 0);
        }
        Ok(file)
    }

    /// Reads the file meta group, after which the data set starts.
    fn read_meta(&mut self) -> Result<(), DicomError> {
        let mut cursor = self.cursor();
        let (mut syntax, mut storage_class, mut group_end) = (None, String::new(), usize::MAX);
        // A deflated data set could start like an element of the group, whose length ends it.
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
        let missing = || DicomError::MissingTag(TRANSFER_SYNTAX.to_string());
        let (start, syntax) = (cursor.at, syntax.ok_or_else(missing)?);
        (self.start, self.syntax, self.storage_class) = (start, syntax, storage_class);
        Ok(())
    }

    fn cursor(&self) -> Cursor<'_> {
        let &Self { ref bytes, start, encoding, .. } = self;
        Cursor { all: bytes, at: start, end: bytes.len(), encoding }
    }

    /// Refuses pixels that are not decoded.
    pub fn check_codec(&self) -> Result<(), DicomError> {
        match self.codec {
            Codec::Unread(name) => Err(unread(&self.syntax, name)),
            _ => Ok(()),
        }
    }

    /// The elements, the structure of which is checked.
    pub fn data_set(&self) -> Result<DataSet<'_>, ImageError> {
        DataSet::read(self.cursor()).map_err(ImageError::in_file(&self.path))
    }
}

/// Encoding, codec of the pixels, and whether the data set is deflated.
fn transfer_syntax(uid: &str) -> Result<(Encoding, Codec, bool), DicomError> {
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
        ".1.98" => Codec::Unread("encapsulated uncompressed"),
        ".4.80" | ".4.81" => Codec::Unread("JPEG-LS"),
        ".4.92" | ".4.93" => Codec::Unread("JPEG 2000 of several components"),
        ".4.110" | ".4.111" | ".4.112" => Codec::Unread("JPEG XL"),
        ".4.201" | ".4.202" | ".4.203" => Codec::Unread("High-Throughput JPEG 2000"),
        video if video.starts_with(".4.10") => Codec::Unread("video"),
        _ => return Err(unread(uid, "unknown")),
    };
    Ok((EXPLICIT_LITTLE, codec, false))
}

fn unread(uid: &str, name: &'static str) -> DicomError {
    DicomError::TransferSyntax { uid: uid.into(), name }
}

fn inflate(deflated: &[u8]) -> Result<Vec<u8>, DicomError> {
    let mut bytes = Vec::new();
    let refuse = |found, want| DicomError::Deflated { found, want };
    DeflateDecoder::new(deflated)
        .take(MAX_INFLATED + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| refuse(source.to_string(), "a whole deflate stream"))?;
    if bytes.len() as u64 > MAX_INFLATED {
        return Err(refuse(format!("over {MAX_INFLATED} bytes"), "at most 1 GiB per file"));
    }
    Ok(bytes)
}
