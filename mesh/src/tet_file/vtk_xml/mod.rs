//! Reads the tetrahedra of VTK XML unstructured grids (.vtu).
//!
//! Arrays may be text, base64 or appended (base64 or raw), plain or compressed with zlib. A
//! reader of its own, since `vtkio` takes no `Int64` cell types and a default header of eight
//! bytes (so that it refuses what meshio writes), leaves out arrays it can't decode without a
//! word, and panics where bytes are missing.

mod array;
mod document;
mod reader;
mod writer;

pub use reader::{TAG_ARRAYS, read_vtu};
pub use writer::{MeshField, write_vtu_plain};
