//! How a VTK XML file stores its arrays, and errors that name a place in it.

use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;

use crate::tet_file::TetMeshError;
use crate::tet_file::file::shortened;

/// What the root element and the appended data say.
pub(super) struct Layout<'a> {
    pub(super) path: &'a Path,
    pub(super) big_endian: bool,
    /// Bytes of the counts before binary data, 4 or 8.
    pub(super) header: usize,
    pub(super) compressor: String,
    /// Whether appended data are base64.
    pub(super) base64: bool,
    /// What follows the underscore of the appended data.
    pub(super) appended: &'a [u8],
}

impl Layout<'_> {
    pub(super) fn syntax(
        &self,
        place: String,
        found: String,
        want: impl Into<String>,
    ) -> TetMeshError {
        let (place, found) = (shortened(&place), shortened(&found));
        TetMeshError::Syntax { path: self.path.into(), place, found, want: want.into() }
    }

    pub(super) fn unsupported(
        &self,
        place: String,
        found: &str,
        advice: &'static str,
    ) -> TetMeshError {
        let (place, found) = (shortened(&place), shortened(found));
        TetMeshError::Unsupported { path: self.path.into(), place, found, advice }
    }

    pub(super) fn claim(&self, place: String, claimed: u64, limit: u64) -> TetMeshError {
        let (what, place) = ("numbers", shortened(&place));
        TetMeshError::Claim { path: self.path.into(), place, what, claimed, limit }
    }
}

/// Attributes of an element, in any order.
pub(super) struct Attributes(Vec<(String, String)>);

impl Attributes {
    pub(super) fn read(
        layout: &Layout,
        place: &str,
        tag: &BytesStart,
    ) -> Result<Self, TetMeshError> {
        let wrong =
            |reason: String| layout.syntax(place.into(), reason, "attributes as name=\"value\"");
        let mut list = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|error| wrong(error.to_string()))?;
            let value = attribute.normalized_value(XmlVersion::Implicit1_0);
            let value = value.map_err(|error| wrong(error.to_string()))?;
            list.push((attribute.key.as_ref().to_string(), value.into_owned()));
        }
        Ok(Self(list))
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}
