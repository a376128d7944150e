//! Cuts: faces between finest tetrahedra that no longer hold together, and the mesh that follows from them.
//!
//! A tetrahedron whose material a cut takes apart has several *sheets*, one for each part that still hangs together:
//! tetrahedra of the same place, each with its share of the material and with corners of its own. Where the material
//! around a vertex no longer hangs together, each part has a vertex of its own there; the others are *twins* of the
//! first. Molino, Bao and Fedkiw, A virtual node algorithm for changing mesh topology during simulation (2004), and
//! Nesme, Kry, Jeřábek and Faure, Preserving topology and elasticity for embedded deformable models (2009), have both.
//!
//! A tetrahedron with a severed face in it or on it stays as it is: nothing around it is split or merged until the cut
//! is closed again. So a cut is refined for before it is made.
//!
//! What does not hang together before any cut, and only shares a tetrahedron, is taken apart in the same way.
//!
//! Open `sever` first: the operation; `separate` is the one for what was never joined. `fine` are the finest tetrahedra and their faces, `finest` finds those of a leaf, `parts` finds what hangs
//! together in one tetrahedron, `stars` what does around a vertex, `record` is what the forest keeps.

mod delta;
mod fine;
mod finest;
mod parts;
mod record;
mod separate;
mod sever;
mod stars;

pub use delta::{CutDelta, Doubled, Part, Recast};
pub use fine::{FineFace, FineTet, finest_at};
pub(crate) use record::Cuts;
pub use record::Severed;
