//! Volume images, the tetrahedral bisection forest with online split and merge, and label trees.
//!
//! This crate knows geometry and labels, no materials and no forces.
#![forbid(unsafe_code)]

mod closure;
mod delta;
mod domain;
mod error;
mod forest;
pub mod geometry;
#[cfg(feature = "gmsh")]
pub mod gmsh;
pub mod kuhn;
mod label_tree;
pub mod lattice;
#[cfg(feature = "nifti")]
mod nifti_reader;
pub mod phantom;
pub mod plain_mesh;
pub mod volume;
#[cfg(feature = "vtu")]
pub mod vtu_reader;

pub use delta::{Change, MeshDelta, RingTet, Tet, TetId, VertexId};
pub use domain::Domain;
pub use error::MeshError;
pub use forest::BisectionForest;
pub use geometry::{Placement, Quality};
pub use kuhn::Point;
pub use label_tree::{CellGrid, Content, LabelTree, LabelsIn, NodeRef};
pub use lattice::Lattice;
pub use plain_mesh::{PlainMesh, Repairs};
