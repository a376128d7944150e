//! Walks over the sections of an MSH file: numbers as text or binary, each with its place.

use super::element::Element;
use crate::tet_file::TetMeshError;

/// How numbers stand in the file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// The two versions that are read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Version {
    Two,
    Four,
}

/// A position in the bytes of a file.
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Name of the open section, without `$`.
    section: String,
    encoding: Encoding,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, section: String::new(), encoding: Encoding::Text }
    }

    pub(super) fn is_text(&self) -> bool {
        self.encoding == Encoding::Text
    }

    /// Section and line, or byte if the file is binary.
    fn place(&self) -> String {
        let section = if self.section.is_empty() { "start" } else { &self.section };
        let dollar = if self.section.is_empty() { "" } else { "$" };
        if self.is_text() {
            let before = &self.bytes[..self.at];
            let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
            format!("{dollar}{section}, line {line}")
        } else {
            format!("{dollar}{section}, byte {}", self.at)
        }
    }

    pub(super) fn syntax(&self, found: impl AsRef<str>, want: impl Into<String>) -> TetMeshError {
        TetMeshError::syntax(self.place(), found, want)
    }

    pub(super) fn unsupported(&self, found: &str, advice: &'static str) -> TetMeshError {
        TetMeshError::unsupported(&self.place(), found, advice)
    }

    /// Refuses a count of items, `bytes` long each at least, that can't all be there.
    pub(super) fn claim(
        &self,
        what: &'static str,
        claimed: u64,
        bytes: usize,
    ) -> Result<(), TetMeshError> {
        let limit = ((self.bytes.len() - self.at) / bytes) as u64;
        if claimed <= limit {
            return Ok(());
        }
        Err(TetMeshError::Claim { place: self.place(), what, claimed, limit })
    }

    fn skip_whitespace(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
    }

    /// The rest of the line, without the white space around it.
    pub(super) fn line(&mut self) -> Result<String, TetMeshError> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return Err(self.syntax("the end of the file", "another line"));
        }
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        Ok(String::from_utf8_lossy(&rest[..length]).trim().to_string())
    }

    /// A line that holds one count, as text in binary files too.
    pub(super) fn line_count(&mut self) -> Result<u64, TetMeshError> {
        self.skip_whitespace();
        let line = self.line()?;
        line.parse().map_err(|_| self.syntax(format!("{line:?}"), "a count"))
    }

    fn word(&mut self, want: &str) -> Result<&'a str, TetMeshError> {
        self.skip_whitespace();
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let word = &rest[..length];
        if word.is_empty() {
            return Err(self.syntax("the end of the file", want));
        }
        let text = std::str::from_utf8(word)
            .map_err(|_| self.syntax(format!("{:?}", String::from_utf8_lossy(word)), want))?;
        self.at += length;
        Ok(text)
    }

    fn parse<T: std::str::FromStr>(&mut self, want: &str) -> Result<T, TetMeshError> {
        let word = self.word(want)?;
        word.parse().map_err(|_| self.syntax(format!("{word:?}"), want))
    }

    fn binary<const N: usize>(&mut self, want: &str) -> Result<[u8; N], TetMeshError> {
        let Some(&(mut bytes)) = self.bytes[self.at..].first_chunk::<N>() else {
            return Err(self.syntax("the end of the file", want));
        };
        self.at += N;
        if self.encoding == Encoding::BigEndian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// An integer: four bytes if binary.
    pub(super) fn int(&mut self, want: &str) -> Result<i64, TetMeshError> {
        if self.is_text() {
            return self.parse(want);
        }
        Ok(i32::from_le_bytes(self.binary(want)?).into())
    }

    /// An integer of four bytes that counts or numbers something.
    pub(super) fn natural(&mut self, want: &str) -> Result<u64, TetMeshError> {
        let value = self.int(want)?;
        u64::try_from(value).map_err(|_| self.syntax(value.to_string(), want))
    }

    /// A size: eight bytes if binary.
    pub(super) fn size(&mut self, want: &str) -> Result<u64, TetMeshError> {
        if self.is_text() {
            return self.parse(want);
        }
        Ok(u64::from_le_bytes(self.binary(want)?))
    }

    /// A finite real number: eight bytes if binary.
    pub(super) fn real(&mut self, want: &str) -> Result<f64, TetMeshError> {
        let value =
            if self.is_text() { self.parse(want)? } else { f64::from_le_bytes(self.binary(want)?) };
        if value.is_finite() { Ok(value) } else { Err(self.syntax(format!("{value}"), want)) }
    }

    pub(super) fn point(&mut self) -> Result<[f64; 3], TetMeshError> {
        const WANT: &str = "a finite coordinate";
        Ok([self.real(WANT)?, self.real(WANT)?, self.real(WANT)?])
    }

    /// An element type: of known length, and no tetrahedron of higher order.
    pub(super) fn element(&mut self) -> Result<Element, TetMeshError> {
        let code = self.int("an element type")?;
        let advice = "save the mesh with first-order elements";
        let Some(element) = Element::of(code) else {
            return Err(self.unsupported(&format!("element type {code}"), advice));
        };
        if let Some(order) = element.curved() {
            let found = format!("a {}-node tetrahedron ({order} order)", element.nodes);
            return Err(self.unsupported(&found, advice));
        }
        Ok(element)
    }

    /// Reads `$MeshFormat`, which must come first but for comments.
    pub(super) fn format(&mut self) -> Result<Version, TetMeshError> {
        const ADVICE: &str = "save the mesh as MSH 4.1 or 2.2";
        loop {
            match self.next_section()?.as_deref() {
                Some("MeshFormat") => break,
                Some("Comments") => self.skip_section()?,
                Some(other) => {
                    let want = "$MeshFormat first, as in a Gmsh mesh";
                    return Err(self.syntax(format!("${other}"), want));
                }
                None => return Err(self.syntax("no section", "$MeshFormat, as in a Gmsh mesh")),
            }
        }
        let line = self.line()?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let [version, kind, size] = words[..] else {
            return Err(self.syntax(format!("{line:?}"), "version, file type, data size"));
        };
        let version = match version {
            "2.2" => Version::Two,
            "4.1" => Version::Four,
            _ => return Err(self.unsupported(&format!("MSH version {version:?}"), ADVICE)),
        };
        if size != "8" {
            return Err(self.syntax(format!("data size {size:?}"), "8"));
        }
        match kind {
            "0" => {}
            "1" => {
                // The integer 1 tells the byte order.
                self.encoding = Encoding::LittleEndian;
                let one = i32::from_le_bytes(self.binary("the integer 1")?);
                if one == 1i32.swap_bytes() {
                    self.encoding = Encoding::BigEndian;
                } else if one != 1 {
                    return Err(self.syntax(one.to_string(), "the integer 1 in either byte order"));
                }
            }
            _ => return Err(self.syntax(format!("file type {kind:?}"), "0 (text) or 1 (binary)")),
        }
        self.end_section()?;
        Ok(version)
    }

    /// Opens the next section; what stands between sections is a comment.
    pub(super) fn next_section(&mut self) -> Result<Option<String>, TetMeshError> {
        self.section.clear();
        loop {
            self.skip_whitespace();
            if self.at == self.bytes.len() {
                return Ok(None);
            }
            let line = self.line()?;
            if let Some(name) = line.strip_prefix('$') {
                self.section = name.chars().take(40).collect();
                return Ok(Some(name.to_string()));
            }
        }
    }

    pub(super) fn end_section(&mut self) -> Result<(), TetMeshError> {
        let end = format!("$End{}", self.section);
        let word = self.word(&end)?;
        if word == end {
            return Ok(());
        }
        Err(self.syntax(format!("{word:?}"), end))
    }

    pub(super) fn skip_section(&mut self) -> Result<(), TetMeshError> {
        let end = format!("$End{}", self.section);
        let rest = &self.bytes[self.at..];
        match rest.windows(end.len()).position(|window| window == end.as_bytes()) {
            Some(position) => {
                self.at += position + end.len();
                Ok(())
            }
            None => Err(self.syntax("no end of the section", end)),
        }
    }
}
