//! What holds material: integrals over fine points of the body, which do not know the mesh.
//!
//! `grip.rs` is weighted points that follow splits and merges, each in one element; `constraints.rs`
//! holds their mean, `loads.rs` is what they and others do to the body. Open `grip.rs` first.

mod constraints;
#[expect(clippy::module_inception)]
mod grip;
mod loads;

pub(crate) use constraints::Turned;
pub use constraints::{Constraints, Responses};
pub use grip::{Grip, WeightedPoint};
pub use loads::{EdgeLoad, Loads};
