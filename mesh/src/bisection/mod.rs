//! The tetrahedral mesh at run time: a bisection forest that refines and coarsens one vertex at a
//! time, and the label tree that says what is inside each of its tetrahedra.
//!
//! Open `forest` first: the data, and how a forest starts. `split_merge` is the one step that all
//! changes are made of; `closure` finds what a split needs before it, `closure_queue` serves split
//! requests within a budget, `refine` splits wherever a question is answered with yes, `relabel` gives the mesh
//! other labels, `cut` takes it apart. `kuhn`
//! holds the bisection rule, `lattice` which vertices exist and which depend on which, `diamond`
//! what is stored per ring, `ring_shape` the table that replaces geometry in a split.

mod closure;
mod closure_queue;
mod cut;
mod delta;
mod diamond;
mod domain;
mod error;
mod forest;
pub mod geometry;
pub mod kuhn;
mod label_tree;
pub mod lattice;
mod memory_order;
mod point_map;
mod queries;
mod refine;
mod relabel;
mod ring_shape;
mod split_merge;

pub use closure_queue::ClosureQueue;
pub use cut::{CutDelta, Doubled, FineFace, FineTet, Part, Recast, Severed, finest_at};
pub use delta::{Change, MeshDelta, RingTet, Tet, TetId, VertexId};
pub use domain::Domain;
pub use error::BisectionError;
pub use forest::BisectionForest;
pub use geometry::{Placement, Quality};
pub use kuhn::Point;
pub use label_tree::{CellGrid, Content, LabelTree, LabelsIn, NodeRef};
pub use lattice::Lattice;
pub use point_map::{ABSENT, PointMap};
pub use refine::{LabelRefinement, Region, Wants};
