//! What holds material: integrals over fine points of the body, which do not know the mesh.
//!
//! `grip.rs` is weighted points that follow splits and merges, each in one element; `constraints.rs`
//! holds their mean, `locate.rs` finds the elements that points lie in. Open `grip.rs` first.

mod constraints;
#[expect(clippy::module_inception)]
mod grip;
mod locate;

pub use constraints::{Constraints, Responses};
pub use grip::{Grip, WeightedPoint};
pub use locate::{Located, locate};
