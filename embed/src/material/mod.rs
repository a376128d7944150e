//! What fine tetrahedra are made of: elasticity matrices, isotropic or not, and which material
//! belongs to which label or voxel. Open `elasticity.rs` first.

mod elasticity;
mod materials;
mod packed;

pub use elasticity::{FineMaterial, Material, isotropic};
pub use materials::{MaterialOfVoxel, Materials, VoidRule};
pub use packed::Packed6;
