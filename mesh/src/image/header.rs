//! Headers made of `field: value` or `field = value` lines, and the data file they name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::image::ImageError;
use crate::image::bytes::ByteStream;

/// Longest header that is read; scanners' metadata come to some ten kilobytes.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Longest piece of a value that a message shows.
const SHOWN_CHARS: usize = 80;

/// One line of a header.
#[derive(Debug, Clone)]
pub(crate) struct TextField {
    pub name: String,
    pub value: String,
    pub line: usize,
}

/// The lines of a header that has been read so far.
pub(crate) struct TextHeader<'a> {
    pub path: &'a Path,
    fields: BTreeMap<String, TextField>,
    line: usize,
    bytes: u64,
}

impl<'a> TextHeader<'a> {
    pub fn new(path: &'a Path) -> Self {
        Self { path, fields: BTreeMap::new(), line: 0, bytes: 0 }
    }

    /// The next line without its end, or `None` at the end of the file.
    pub fn next_line(&mut self, stream: &mut ByteStream) -> Result<Option<String>, ImageError> {
        let mut line = stream.line(MAX_HEADER_BYTES - self.bytes)?;
        if line.is_empty() && self.bytes < MAX_HEADER_BYTES {
            return Ok(None);
        }
        self.line += 1;
        self.bytes += line.len() as u64;
        if self.bytes >= MAX_HEADER_BYTES {
            let limit = MAX_HEADER_BYTES;
            return Err(ImageError::HeaderTooLong { path: self.path.into(), limit });
        }
        while line.last().is_some_and(|end| b"\r\n".contains(end)) {
            line.pop();
        }
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }

    /// The line read last, as a field: `key` is the name as it is looked up.
    pub fn insert(&mut self, key: String, name: &str, value: &str) -> Result<(), ImageError> {
        let (name, value) = (name.trim().to_string(), value.trim().to_string());
        let field = TextField { name, value, line: self.line };
        if self.fields.contains_key(&key) {
            return Err(self.refuse(&field, "the field once"));
        }
        self.fields.insert(key, field);
        Ok(())
    }

    /// The line read last is not what a header holds.
    pub fn refuse_line(&self, text: &str, want: &'static str) -> ImageError {
        let field = TextField { name: "the line".into(), value: text.to_string(), line: self.line };
        self.refuse(&field, want)
    }

    pub fn refuse(&self, field: &TextField, want: &'static str) -> ImageError {
        let shown = |text: &str| text.chars().take(SHOWN_CHARS).collect::<String>();
        ImageError::TextHeader {
            path: self.path.into(),
            line: field.line,
            field: shown(&field.name),
            value: shown(&field.value),
            want,
        }
    }

    pub fn get(&self, key: &str) -> Option<&TextField> {
        self.fields.get(key)
    }

    /// The field, or an error that names it as `name`.
    pub fn require(&self, key: &str, name: &'static str) -> Result<&TextField, ImageError> {
        let missing = || ImageError::MissingField { path: self.path.into(), field: name };
        self.fields.get(key).ok_or_else(missing)
    }

    /// A whole number.
    pub fn integer(&self, field: &TextField, want: &'static str) -> Result<i64, ImageError> {
        field.value.parse().map_err(|_| self.refuse(field, want))
    }

    /// `count` numbers parted by blanks; they may be NaN.
    pub fn numbers(
        &self,
        field: &TextField,
        count: usize,
        want: &'static str,
    ) -> Result<Vec<f64>, ImageError> {
        let numbers: Result<Vec<f64>, _> =
            field.value.split_whitespace().take(count + 1).map(str::parse).collect();
        match numbers {
            Ok(numbers) if numbers.len() == count => Ok(numbers),
            _ => Err(self.refuse(field, want)),
        }
    }

    /// Voxels along `count` axes, each at least 1.
    pub fn sizes(&self, field: &TextField, count: usize) -> Result<Vec<u64>, ImageError> {
        let want = "one whole number ≥ 1 per dimension";
        let sizes: Result<Vec<u64>, _> =
            field.value.split_whitespace().take(count + 1).map(str::parse).collect();
        match sizes {
            Ok(sizes) if sizes.len() == count && !sizes.contains(&0) => Ok(sizes),
            _ => Err(self.refuse(field, want)),
        }
    }

    /// The file that a field names, in the header's own folder.
    pub fn data_file(&self, field: &TextField) -> Result<PathBuf, ImageError> {
        let value = field.value.as_str();
        if value.split_whitespace().next() == Some("LIST") {
            return Err(self.refuse(field, "one data file; join the listed ones first"));
        }
        if value.contains('%') {
            return Err(self.refuse(field, "one data file; join those of the pattern first"));
        }
        let name = value.strip_prefix("./").unwrap_or(value);
        // A header from elsewhere must not make any file of this machine an image.
        if name.is_empty() || name == ".." || name.contains(['/', '\\', '\0']) {
            return Err(self.refuse(field, "the name of a file in the header's own folder"));
        }
        Ok(self.path.with_file_name(name))
    }
}
