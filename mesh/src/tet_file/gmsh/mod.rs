//! Reads and writes Gmsh meshes: MSH 2.2 and 4.1, text and binary.
//!
//! Both versions are sequences of `$Name … $EndName` sections. Four-node tetrahedra are taken;
//! other first-order elements are counted and passed over, and so are comments, fields and
//! unknown sections.
//!
//! Source: Gmsh reference manual, chapter "Gmsh file formats",
//! <https://gmsh.info/doc/texinfo/gmsh.html#Gmsh-file-formats>.
//!
//! Open `reader` first; `msh22` and `msh41` read the sections that differ between the versions,
//! `scanner` finds sections and numbers in the bytes.

mod content;
mod element;
mod msh22;
mod msh41;
mod reader;
mod scanner;
mod writer;

pub use reader::read_msh;
pub use writer::{write_msh22, write_msh41};
