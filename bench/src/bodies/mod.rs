//! Bodies that benches and studies work on.
//!
//! Start with `organ.rs`: the liver phantom that most of them share. `block.rs` is a unit cube at
//! rest under load (its meshes are in `cube_mesh.rs`), `solid.rs` makes bodies of simple shapes
//! without a bisection mesh, `statics.rs` solves them, `beams.rs` bends them.

pub(crate) mod beams;
pub(crate) mod block;
pub(crate) mod cube_mesh;
pub(crate) mod organ;
pub(crate) mod solid;
pub(crate) mod statics;

pub(crate) use cube_mesh::CubeMesh;
pub(crate) use organ::organ_materials;
pub(crate) use solid::Solid;
pub(crate) use statics::Statics;
