//! VTK XML files: unstructured grids (.vtu) read and written, PolyData (.vtp) written, the elements
//! of image data (.vti) found and decoded.
//!
//! Open `writer` for writing: one writer for all files, arrays in base64 or appended raw. For
//! reading, `document` finds the elements and `array` decodes their numbers (text, base64 or
//! appended, plain or compressed with zlib); `reader` makes tetrahedra of them, [`crate::image`]
//! images, `fields` cells with all that is on them (all behind the feature `vtu`). `plain` writes a
//! plain mesh with fields.
//!
//! A reader of our own, since `vtkio` 0.6 takes no `Int64` cell types and a default header of
//! eight bytes (so that it refuses what meshio writes), leaves out arrays it can't decode without
//! a word, and panics where bytes are missing.

#[cfg(feature = "vtu")]
mod array;
#[cfg(feature = "vtu")]
mod document;
#[cfg(feature = "vtu")]
mod fields;
#[cfg(feature = "vtu")]
mod plain;
#[cfg(feature = "vtu")]
mod reader;
mod writer;

#[cfg(feature = "vtu")]
pub(crate) use array::{Array, Attributes};
#[cfg(feature = "vtu")]
pub(crate) use document::{Document, Piece};
#[cfg(feature = "vtu")]
pub use fields::{VtkFields, read_vtp_fields, read_vtu_fields};
#[cfg(feature = "vtu")]
pub use plain::{MeshField, write_vtu_plain};
#[cfg(feature = "vtu")]
pub use reader::{TAG_ARRAYS, read_vtu};
pub(crate) use writer::triangles_xml;
pub use writer::{VtkArray, VtkValues, tetrahedra_xml};
