//! The inverse of a symmetric stiffness matrix, positive definite or quasi-definite, kept up to
//! date while vertices come and go.
//!
//! This crate knows matrices and index sets, no meshes. Its own terms:
//!
//! - A *vertex* is a block of [`SparseStiffness::block`] rows (3 displacements, or 4 with a
//!   pressure). A *slot* is its number, `0..vertices()`: a split appends one slot; a merge removes
//!   one and moves the last vertex into the gap (as `Vec::swap_remove`), so that storage stays
//!   dense.
//! - A *ring* (edge star, edge patch) is the set of elements around a bisected edge. Splitting the
//!   edge changes K on the vertices of these elements alone; a [`RingChange`] says how.
//! - A [`StiffnessChange`] is a change of *content*: an element gets another material, and all
//!   vertices stay.
//! - A *batch* is a sequence of such [`Update`]s made in one call, which a maintainer may combine.
//! - [`FreshRows`] are block rows of K summed anew from their elements, in the place of what rounding in
//!   updates has left of them.
//!
//! [`InverseMaintainer`] is the stage, [`build`] makes one by name. `matrix` holds K itself,
//! `change` the updates of K, `dense` and `sparse` the methods by which a [`Maintained`] keeps its
//! inverse, `accuracy` how residuals and drift are measured.
#![forbid(unsafe_code)]

mod accuracy;
mod change;
mod choice;
mod dense;
mod error;
#[cfg(test)]
mod lattice;
mod maintained;
mod maintainer;
mod matrix;
mod sparse;
mod two_level;

pub use accuracy::{
    DRIFT_LIMIT, DRIFT_LIMIT_F32, MOST_REFINEMENTS, REFINED_RESIDUAL, REFINEMENT_LIMIT,
};
pub use change::{CONSISTENCY_LIMIT, RingChange, StiffnessChange, Update};
pub use choice::{CHOICES, build, choose};
pub use dense::{
    Delayed, DenseStore, HostStore, Lu, MOST_DELAYED, Paper, Precision, Staged, Woodbury,
    WoodburyF32,
};
pub use error::{InverseError, StorageError};
pub use maintained::Maintained;
pub use maintainer::{Counts, InverseMaintainer, Load, drift};
pub use matrix::{FreshRows, SYMMETRY_LIMIT, SparseStiffness};
pub use sparse::{RebaseOptions, Sparse, elimination_order};
pub use two_level::{TwoLevel, TwoLevelOptions};
