//! One tetrahedron: its state, the rotation nearest to its deformation gradient, the way from a
//! stress to forces on its corners, and what pressures add to it in a mixed body.
//!
//! `turning.rs` is what the turning of an element adds to its stress; `point.rs` is a point of the material by
//! its element. Open `tetrahedron.rs` first. Nothing here
//! knows of a body.

mod point;
pub(crate) mod pressures;
pub mod rotation;
pub(crate) mod tetrahedron;
pub(crate) mod turning;

pub use point::{EDGES, ElementPoint, locate};
pub use tetrahedron::Element;
