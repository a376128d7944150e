//! Iso-surfaces by marching tetrahedra: closed, oriented, bound to mesh edges.
//!
//! A field has one value per mesh vertex; *inside* is where it is at least the level. Every
//! crossed mesh edge holds exactly one surface vertex at
//! t = (level − f(a)) / (f(b) − f(a)), with a < b the edge's vertex numbers, clamped to
//! \[ε, 1 − ε\]. It is computed once per edge, so tetrahedra of any level that share the edge
//! share the vertex bit by bit, and a conforming mesh has a surface without cracks. Bound to
//! (edge, t), the surface deforms with the mesh.
//!
//! Source: Doi and Koide, IEICE Transactions E74(1), 1991; 16 cases.
//!
//! Open `surface` first; `cases` holds the sixteen cases. `label_field` and `label_boundary` make
//! fields and refinement from labels, `outlines` puts them together; `measure` knows area, volume
//! and topology; `ply` and `vtp` write files of checked `surface_data`.

mod cases;
mod error;
mod label_boundary;
mod label_field;
mod measure;
mod outlines;
mod ply;
mod surface;
mod surface_data;
mod vtp;

pub use error::SurfaceError;
pub use label_boundary::LabelBoundary;
pub use label_field::LabelField;
pub use measure::{area, volume};
pub use outlines::{Outline, Outlines};
pub use ply::{PlyEncoding, write_ply};
pub use surface::{EDGE_MARGIN, IsoSurface, SurfaceOptions, SurfaceVertex};
pub use surface_data::SurfaceData;
pub use vtp::write_vtp;
