//! Volume images, the tetrahedral bisection forest with online split and merge, and label trees.
//!
//! This crate knows geometry and labels, no materials and no forces. [`image`] reads volumes,
//! [`bisection`] meshes them, [`isosurface`] and [`tet_file`] take surfaces and meshes out and in,
//! [`phantom`] makes organs without a scanner.
//!
//! # Terms
//!
//! - *Ring*: the tetrahedra around an edge that is bisected; elsewhere *edge star* or *edge
//!   patch*. A split replaces each tetrahedron of one ring by its two halves and adds the vertex
//!   at the edge's midpoint; a merge takes that back.
//! - *Diamond*: what the forest stores of one ring, known by the midpoint of the edge, whether or
//!   not it is bisected (*diamond hierarchy* in Weiss and De Floriani, 2011).
//! - *Label tree*: the binary tree of all tetrahedra that bisection can make, with the labels of
//!   the voxels inside each; a subtree of one label is a single number.
#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod bisection;
pub mod image;
pub mod isosurface;
pub mod phantom;
pub mod tet_file;
mod union_find;

pub use bisection::{
    BisectionError, BisectionForest, CellGrid, Change, ClosureQueue, Content, CutDelta, Domain,
    Doubled, FineFace, FineTet, LabelRefinement, LabelTree, LabelsIn, Lattice, MeshDelta, NodeRef,
    Part, Placement, Point, Quality, Recast, Region, RingTet, Severed, Tet, TetId, VertexId, Wants,
    finest_at, geometry, kuhn, lattice,
};
pub use image::{ImageError, volume};
pub use isosurface::SurfaceError;
pub use tet_file::{PlainMesh, Repairs, TetMeshError};
