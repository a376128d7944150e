//! Tetrahedral meshes made by other programs, and the files that hold them.
//!
//! Open `mesh` first: a plain mesh, checked by `check` and `faces`. `gmsh` (MSH 2.2 and 4.1) and
//! `vtk_xml` (.vtu) read and write files, readers behind a feature each; `file` is what they share.

mod check;
mod error;
mod faces;
#[cfg(any(feature = "gmsh", feature = "vtu"))]
mod file;
#[cfg(feature = "gmsh")]
mod gmsh;
mod mesh;
mod vtk_xml;

pub use check::FLATNESS;
pub use error::TetMeshError;
#[cfg(feature = "gmsh")]
pub use gmsh::{read_msh, write_msh22, write_msh41};
pub use mesh::{LoadedMesh, PlainMesh, Repairs};
pub(crate) use vtk_xml::triangles_xml;
#[cfg(feature = "vtu")]
pub(crate) use vtk_xml::{Array, Attributes, Document, Piece};
#[cfg(feature = "vtu")]
pub use vtk_xml::{
    MeshField, TAG_ARRAYS, VtkFields, read_vtp_fields, read_vtu, read_vtu_fields, write_vtu_plain,
};
pub use vtk_xml::{VtkArray, VtkValues, tetrahedra_xml};
