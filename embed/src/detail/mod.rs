//! A mesh that is too fine to be simulated and moves along with the coarse one.
//!
//! `mesh.rs` knows how its vertices depend on each other, `follower.rs` keeps the positions of
//! those that are asked for. Open `mesh.rs` first.

mod follower;
mod mesh;

pub use follower::Follower;
pub use mesh::{DetailMesh, RotationOf};
