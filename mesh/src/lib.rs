//! Volume images, the tetrahedral bisection forest with online split and merge, and label trees.
//!
//! This crate knows geometry and labels, no materials and no forces.
#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod bisection;
pub mod image;
pub mod isosurface;
pub mod phantom;
pub mod tet_file;

pub use bisection::{
    BisectionError, BisectionForest, CellGrid, Change, ClosureQueue, Content, Domain,
    LabelRefinement, LabelTree, LabelsIn, Lattice, MeshDelta, NodeRef, Placement, Point, Quality,
    Region, RingTet, Tet, TetId, VertexId, Wants, geometry, kuhn, lattice,
};
pub use image::{ImageError, volume};
pub use isosurface::SurfaceError;
pub use tet_file::{PlainMesh, Repairs, TetMeshError};
