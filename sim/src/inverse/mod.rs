//! From the mesh to the inverse of its stiffness matrix: slots, assembly, hand-over of changes.
//!
//! Start with [`InverseLink`] (`link.rs`): a maintained inverse that follows splits and merges of a
//! mesh. It is made of three parts that anybody can use alone: [`SlotMap`] (`slots.rs`) says which
//! vertex has which slot of the matrix, [`Assembly`] (`assembly.rs`) makes the matrix from elements,
//! [`SlotMap::update`] and [`SlotMap::content_change`] (`hand_over.rs`) turn a ring of the mesh, or
//! a leaf of another material, into an update of the inverse.
//! `layout.rs` keeps what it takes to assemble K, or rows of it, at any time.
//! `held.rs` holds further vertices in a solve, without a change of the inverse, and `applied.rs` is what
//! an equilibrium gets of it.

mod applied;
mod assembly;
mod hand_over;
mod held;
mod layout;
mod link;
mod slots;

pub(crate) use applied::Applied;
pub use assembly::Assembly;
pub use hand_over::hold;
pub(crate) use held::Constrained;
pub use layout::Elements;
pub(crate) use link::KeptInverse;
pub use link::{InverseFactory, InverseLink};
pub use slots::SlotMap;

/// Displacements of a vertex, the first of its unknowns.
const DISPLACEMENTS: usize = 3;
