//! Materials, element stiffness and hierarchical homogenised embedding of fine material in
//! coarse tetrahedra.
//!
//! A coarse tetrahedron carries one symmetric 6×6 elasticity matrix D_p that stands for all
//! the fine material inside it, and each bisection one matrix X that says how far the new
//! vertex deviates from the middle of its edge under a given strain. How D_p and X follow from
//! the two halves is a [`Homogenisation`]; adding one is adding a file.
//!
//! Voigt order xx yy zz xy yz zx with engineering shear; degrees of freedom vertex-major x, y, z.
#![forbid(unsafe_code)]

mod detail;
mod elasticity;
mod element;
mod embedding;
mod error;
mod fine;
mod follower;
mod homogenisation;
mod materials;
mod packed;
mod ring;

pub use detail::{DetailMesh, RotationOf};
pub use elasticity::{FineMaterial, Material, isotropic};
pub use element::{LinearTet, Strain, strain_from_gradient, strain_operator};
pub use embedding::Embedding;
pub use error::EmbedError;
pub use fine::{DIRECT_VERTICES, FineBody, FineFields, SixFields};
pub use follower::Follower;
pub use homogenisation::{
    CHOICES, ChildPair, Excess, GlobalHomogenisation, Homogenisation, Kharevych, Laminate, Linear,
    Paper, ParentMaterial, by_name,
};
pub use materials::{MaterialOfVoxel, Materials};
pub use packed::Packed6;
pub use ring::RingStiffness;
