//! Headers made of `field: value` or `field = value` lines, and the data file they name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::image::ImageError;
use crate::image::bytes::ByteStream;

/// Longest header that is read; scanners' metadata come to some ten kilobytes.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Longest piece of a value that a message shows.
const SHOWN_CHARS: usize = 80;

/// One line of a header.
pub(crate) struct TextField {
    pub name: String,
    pub value: String,
    pub line: usize,
}

/// The lines of a header that has been read so far.
#[derive(Default)]
pub(crate) struct TextHeader {
    fields: BTreeMap<String, TextField>,
    line: usize,
    bytes: u64,
}

impl TextHeader {
    /// The next line without its end, or `None` at the end of the file.
    pub fn next_line(&mut self, stream: &mut ByteStream) -> Result<Option<String>, ImageError> {
        let line = stream.line(MAX_HEADER_BYTES - self.bytes)?;
        if line.is_empty() && self.bytes < MAX_HEADER_BYTES {
            return Ok(None);
        }
        self.line += 1;
        self.bytes += line.len() as u64;
        if self.bytes >= MAX_HEADER_BYTES {
            return Err(ImageError::HeaderTooLong(MAX_HEADER_BYTES));
        }
        Ok(Some(String::from_utf8_lossy(&line).trim_end_matches(['\r', '\n']).into()))
    }

    /// Takes the line read last as a field.
    pub fn insert(&mut self, name: &str, value: &str) -> Result<(), ImageError> {
        let key = key(name);
        let (name, value) = (name.trim().to_string(), value.trim().to_string());
        let field = TextField { name, value, line: self.line };
        if self.fields.contains_key(&key) {
            return Err(field.refuse("the field once"));
        }
        self.fields.insert(key, field);
        Ok(())
    }

    /// The line read last is not what a header holds.
    pub fn refuse_line(&self, text: &str, want: &'static str) -> ImageError {
        TextField { name: "the line".into(), value: text.into(), line: self.line }.refuse(want)
    }

    pub fn get(&self, name: &str) -> Option<&TextField> {
        self.first(&[name])
    }

    /// The first of these fields that is there: they mean the same.
    pub fn first(&self, names: &[&str]) -> Option<&TextField> {
        names.iter().find_map(|name| self.fields.get(&key(name)))
    }

    pub fn require(&self, name: &'static str) -> Result<&TextField, ImageError> {
        self.get(name).ok_or(ImageError::MissingField(name))
    }

    /// Voxels along all axes, each at least 1, by the fields `rank` (3 to `most`) and `sizes`.
    pub fn sizes(
        &self,
        rank: &'static str,
        sizes: &'static str,
        most: usize,
        want: &'static str,
    ) -> Result<Vec<u64>, ImageError> {
        let field = self.require(rank)?;
        let rank = field.parse(want)?;
        if !(3..=most).contains(&rank) {
            return Err(field.refuse(want));
        }
        let (field, want) = (self.require(sizes)?, "one whole number ≥ 1 per dimension");
        let sizes = field.list(rank, want)?;
        if sizes.contains(&0) { Err(field.refuse(want)) } else { Ok(sizes) }
    }
}

/// What a field is looked up by: writers may drop blanks and capitals.
fn key(name: &str) -> String {
    name.split_whitespace().collect::<String>().to_ascii_lowercase()
}

/// The sizes of the three axes of space, if all others have size 1.
pub(crate) fn only_three(sizes: &[u64], axes: [usize; 3]) -> Result<[u64; 3], ImageError> {
    let others = (0..sizes.len()).filter(|axis| !axes.contains(axis));
    let count = others.fold(1u64, |product, axis| product.saturating_mul(sizes[axis]));
    let rank = sizes.len() as i16;
    if count > 1 {
        return Err(ImageError::NotThreeDimensional { rank: rank.into(), count });
    }
    Ok(axes.map(|axis| sizes[axis]))
}

impl TextField {
    pub fn refuse(&self, want: &'static str) -> ImageError {
        let shown = |text: &str| text.chars().take(SHOWN_CHARS).collect::<String>();
        let (line, field, value) = (self.line, shown(&self.name), shown(&self.value));
        ImageError::TextHeader { line, field, value, want }
    }

    /// What the value stands for in a table of words, whatever their capitals.
    pub fn choice<T: Copy>(
        &self,
        table: &[(&[&str], T)],
        want: &'static str,
    ) -> Result<T, ImageError> {
        let words: Vec<&str> = self.value.split_whitespace().collect();
        let value = words.join(" ").to_ascii_lowercase();
        let found = table.iter().find(|(words, _)| words.contains(&value.as_str()));
        found.map(|&(_, meaning)| meaning).ok_or_else(|| self.refuse(want))
    }

    /// One number.
    pub fn parse<T: FromStr>(&self, want: &'static str) -> Result<T, ImageError> {
        self.value.parse().map_err(|_| self.refuse(want))
    }

    /// `count` numbers parted by blanks; those of floats may be NaN.
    pub fn list<T: FromStr>(&self, count: usize, want: &'static str) -> Result<Vec<T>, ImageError> {
        let words = self.value.split_whitespace().take(count + 1);
        let list: Option<Vec<T>> = words.map(|word| word.parse().ok()).collect();
        list.filter(|list| list.len() == count).ok_or_else(|| self.refuse(want))
    }

    /// The file that the value names, in the folder of the header at `path`.
    pub fn data_file(&self, path: &Path) -> Result<PathBuf, ImageError> {
        if self.value.split_whitespace().next() == Some("LIST") {
            return Err(self.refuse("one data file; join the listed ones first"));
        }
        if self.value.contains('%') {
            return Err(self.refuse("one data file; join those of the pattern first"));
        }
        let name = self.value.strip_prefix("./").unwrap_or(&self.value);
        // A header from elsewhere must not make any file of this machine an image.
        if name.is_empty() || name == ".." || name.contains(['/', '\\', '\0']) {
            return Err(self.refuse("the name of a file in the header's own folder"));
        }
        Ok(path.with_file_name(name))
    }
}
