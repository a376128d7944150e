//! One tetrahedron: its state, the rotation nearest to its deformation gradient, the way from a
//! stress to forces on its corners, and what pressures add to it in a mixed body.
//!
//! `turning.rs` is what the turning of an element adds to its stress; `point.rs` is a point of the material by
//! its element, `bins.rs` finds points near a box. Open `tetrahedron.rs` first. Nothing here
//! knows of a body.

mod bins;
mod point;
pub(crate) mod pressures;
pub mod rotation;
pub(crate) mod tetrahedron;
pub(crate) mod turning;

pub(crate) use point::elements_of;
pub use point::{EDGES, ElementPoint, locate};
pub use tetrahedron::Element;
