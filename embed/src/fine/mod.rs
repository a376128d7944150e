//! The finest tetrahedra of a whole body: what a homogenisation sees that asks for more than two
//! halves.
//!
//! `body.rs` visits them, `tractions.rs` solves for their displacements: by `cholesky.rs` or, for
//! many vertices, by `conjugate_gradients.rs` with `multigrid/` before it. Open `body.rs` first.

mod body;
mod cholesky;
mod conjugate_gradients;
mod grid;
mod multigrid;
mod region;
mod stiffness;
mod tractions;

pub use body::{FineBody, SixFields};
pub(crate) use body::{lattice_tet, voxel};
pub use cholesky::{DIRECT_VERTICES, LdlPattern, SparseCholesky, SparseLdl};
pub(crate) use region::FineVoxels;
pub use tractions::FineFields;
