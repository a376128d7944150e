//! What a change of the mesh does to the stiffness, in the factored form that the inverse wants.
//!
//! `ring.rs` is a split or merge, summed up from the tetrahedra around its edge (`halved.rs`);
//! `clamp.rs` takes fixed displacements out of it. Open `ring.rs` first.

mod clamp;
mod halved;
mod ring;

pub use clamp::clamp;
pub use halved::Halved;
pub use ring::{RingPart, RingStiffness};
