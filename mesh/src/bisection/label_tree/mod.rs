//! What is inside each tetrahedron of the hierarchy: labels, bottom-up and exact.
//!
//! The tree bisects root cubes down to `embed_level`, where one TYPE0 cube is one voxel. A
//! subtree of one label is a single number, so memory follows the label boundaries and not the
//! volume. Voxels are never sampled at tetrahedron centroids above that level (they lie on the
//! tetrahedra's planes): labels only move up by union. Labels whose voxels are not all alike keep
//! a node per finest tetrahedron.
//!
//! Open `tree` first; `subtree` builds the part in one root cube, `node` is the content of one
//! tetrahedron, `cell_grid` places the root cubes on the voxels.

mod cell_grid;
mod node;
mod subtree;
mod tree;

pub use cell_grid::CellGrid;
pub use node::{Content, NodeRef};
pub use tree::{LabelTree, LabelsIn};
