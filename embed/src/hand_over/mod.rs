//! What a change of the body does to the stiffness, in the factored form that the inverse wants.
//!
//! `ring.rs` is a split or merge, summed up from the tetrahedra around its edge (`halved.rs`);
//! `doubling.rs` a vertex that a cut doubles, in the same form; `content.rs` a change of the material of a leaf;
//! `clamp.rs` takes fixed displacements out of both forms. Open `ring.rs` first.

mod clamp;
mod content;
mod doubling;
mod halved;
mod ring;

pub use clamp::clamp;
pub use content::ContentStiffness;
pub use halved::Halved;
pub use ring::{RingPart, RingStiffness};
