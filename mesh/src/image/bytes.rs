//! The bytes of an image file, inflated where they are compressed.
//!
//! Memory grows with the bytes that arrive, never with what a header claims.

// Each format needs another part.
#![cfg_attr(not(all(feature = "nifti", feature = "nrrd", feature = "metaimage")), allow(dead_code))]

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::{MultiGzDecoder, ZlibDecoder};

use crate::image::ImageError;

/// Start of every gzip stream.
pub(crate) const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

const VOXEL_DATA: &str = "voxel data";

/// What is left of a file.
pub(crate) struct ByteStream {
    path: PathBuf,
    source: Box<dyn BufRead>,
    /// Bytes left, where that is known beforehand: only inflating tells it of a compressed file.
    left: Option<u64>,
}

impl ByteStream {
    /// The plain bytes of a regular file that is not empty.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        let (source, length) = open(path).map_err(ImageError::in_file(path))?;
        Ok(Self { path: path.into(), source: Box::new(source), left: Some(length) })
    }

    /// Whether nothing is left.
    fn at_end(&mut self) -> Result<bool, ImageError> {
        match self.source.fill_buf() {
            Ok(bytes) => Ok(bytes.is_empty()),
            Err(error) => Err(self.failure(error)),
        }
    }

    /// Whether the next bytes are these (at most a buffer's worth).
    pub fn starts_with(&mut self, magic: &[u8]) -> Result<bool, ImageError> {
        match self.source.fill_buf() {
            Ok(bytes) => Ok(bytes.starts_with(magic)),
            Err(error) => Err(self.failure(error)),
        }
    }

    /// The rest, as the content of a gzip stream of one or more members.
    pub fn inflate_gzip(self) -> Self {
        let source = Box::new(BufReader::new(MultiGzDecoder::new(self.source)));
        Self { path: self.path, source, left: None }
    }

    /// The rest, as the content of a zlib stream.
    pub fn inflate_zlib(self) -> Self {
        let source = Box::new(BufReader::new(WholeZlib(ZlibDecoder::new(self.source))));
        Self { path: self.path, source, left: None }
    }

    /// That no more than `bytes` are left of a plain file.
    pub fn check_rest(&self, bytes: u64) -> Result<(), ImageError> {
        match self.left {
            Some(left) if left > bytes => Err(self.too_long(bytes)),
            _ => Ok(()),
        }
    }

    /// Up to `want` bytes, fewer only at the end of the file.
    pub fn take(&mut self, want: u64) -> Result<Vec<u8>, ImageError> {
        let mut bytes = Vec::new();
        let result = self.source.by_ref().take(want).read_to_end(&mut bytes);
        self.consumed(bytes.len() as u64);
        match result {
            Ok(_) => Ok(bytes),
            // A compressed stream cut short: what came before the cut tells what is missing.
            Err(error) if self.cut(&error) => Ok(bytes),
            Err(error) => Err(self.failure(error)),
        }
    }

    /// The next line with its end, at most `limit` bytes of it; empty at the end of the file.
    pub fn line(&mut self, limit: u64) -> Result<Vec<u8>, ImageError> {
        let mut line = Vec::new();
        match self.source.by_ref().take(limit).read_until(b'\n', &mut line) {
            Ok(_) => self.consumed(line.len() as u64),
            Err(error) => return Err(self.failure(error)),
        }
        Ok(line)
    }

    /// Passes over `bytes`, which hold `part`.
    pub fn skip(&mut self, bytes: u64, part: &'static str) -> Result<(), ImageError> {
        let skipped = match io::copy(&mut self.source.by_ref().take(bytes), &mut io::sink()) {
            Ok(skipped) => skipped,
            Err(error) if self.cut(&error) => 0,
            Err(error) => return Err(self.failure(error)),
        };
        self.consumed(skipped);
        if skipped < bytes { Err(self.length_error(part, skipped, bytes)) } else { Ok(()) }
    }

    /// Passes over this many lines; false if there are fewer.
    pub fn skip_lines(&mut self, lines: u64) -> Result<bool, ImageError> {
        for _ in 0..lines {
            match self.source.skip_until(b'\n') {
                Ok(0) => return Ok(false),
                Ok(bytes) => self.consumed(bytes as u64),
                Err(error) => return Err(self.failure(error)),
            }
        }
        Ok(true)
    }

    /// Passes over all but the last `bytes` of a plain file.
    pub fn skip_to_last(&mut self, bytes: u64) -> Result<(), ImageError> {
        let left = self.left.unwrap_or(0);
        match left.checked_sub(bytes) {
            Some(before) => self.skip(before, "what stands before the voxel data"),
            None => Err(self.length_error(VOXEL_DATA, left, bytes)),
        }
    }

    /// Whether a plain file holds `want` bytes of voxels after `before` others.
    pub fn check_length(&self, before: u64, want: u64) -> Result<(), ImageError> {
        match self.left.map(|left| left.saturating_sub(before)) {
            Some(found) if found < want => Err(self.length_error(VOXEL_DATA, found, want)),
            _ => Ok(()),
        }
    }

    /// The `want` bytes of all voxels, which must be the last ones. Looking for one more makes an
    /// inflater check sum and length of its stream.
    pub fn voxel_bytes(&mut self, want: u64) -> Result<Vec<u8>, ImageError> {
        self.check_length(0, want)?;
        let bytes = self.take(want)?;
        if (bytes.len() as u64) < want {
            return Err(self.length_error(VOXEL_DATA, bytes.len() as u64, want));
        }
        if !self.at_end()? {
            return Err(self.too_long(want));
        }
        Ok(bytes)
    }

    /// An error that tells how many bytes are missing.
    pub fn length_error(&self, part: &'static str, found: u64, want: u64) -> ImageError {
        ImageError::in_file(&self.path)(ImageError::Length { part, found, want })
    }

    fn too_long(&self, want: u64) -> ImageError {
        ImageError::in_file(&self.path)(ImageError::TooLong { unit: "bytes", want })
    }

    fn consumed(&mut self, bytes: u64) {
        self.left = self.left.map(|left| left.saturating_sub(bytes));
    }

    fn cut(&self, error: &io::Error) -> bool {
        self.left.is_none() && error.kind() == io::ErrorKind::UnexpectedEof
    }

    fn failure(&self, source: io::Error) -> ImageError {
        let kind = if self.left.is_some() { ImageError::Io } else { ImageError::Inflate };
        ImageError::in_file(&self.path)(kind(source))
    }
}

/// A zlib stream that must be all of its source.
struct WholeZlib(ZlibDecoder<Box<dyn BufRead>>);

impl Read for WholeZlib {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.0.read(buffer)?;
        if read == 0 && !buffer.is_empty() && !self.0.get_mut().fill_buf()?.is_empty() {
            let problem = "more bytes follow the end of the zlib stream";
            return Err(io::Error::new(io::ErrorKind::InvalidData, problem));
        }
        Ok(read)
    }
}

fn open(path: &Path) -> Result<(BufReader<File>, u64), ImageError> {
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a directory" } else { "no regular file" };
        return Err(ImageError::NotAFile(found));
    }
    let mut source = BufReader::new(File::open(path)?);
    if source.fill_buf()?.is_empty() {
        return Err(ImageError::EmptyFile);
    }
    Ok((source, metadata.len()))
}
