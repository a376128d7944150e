//! Materials, element stiffness and hierarchical homogenised embedding of fine material in
//! coarse tetrahedra.
//!
//! A coarse tetrahedron carries one symmetric 6×6 elasticity matrix D_p that stands for all
//! the fine material inside it, and each bisection one matrix X that says how far the new
//! vertex deviates from the middle of its edge under a given strain. How D_p and X follow from
//! the two halves is a [`Homogenisation`]; adding one is adding a file.
//!
//! What a tetrahedron's vertices carry is an [`ElementFormulation`]: displacements (`p1`), or a
//! pressure beside them where volume is nearly kept (`p1p1`). It makes the element's matrix and the
//! hand-over of a split or merge to the inverse, [`RingStiffness`].
//!
//! Voigt order xx yy zz xy yz zx with engineering shear; degrees of freedom vertex-major x, y, z.
#![forbid(unsafe_code)]

mod clamp;
mod detail;
mod elasticity;
mod element;
mod embedding;
mod error;
mod fine;
mod follower;
mod formulation;
mod homogenisation;
mod mass;
mod materials;
mod packed;
mod ring;

pub use clamp::clamp;
pub use detail::{DetailMesh, RotationOf};
pub use elasticity::{FineMaterial, Material, isotropic};
pub use element::{LinearTet, Strain, strain_from_gradient, strain_operator};
pub use embedding::Embedding;
pub use error::EmbedError;
pub use fine::{DIRECT_VERTICES, FineBody, FineFields, SixFields, SparseCholesky};
pub use follower::Follower;
pub use formulation::{
    Dynamic, ElementFormulation, EulerWeights, FORMULATIONS, MixedModuli, P1, P1P1,
    dynamic_by_name, formulation_by_name,
};
pub use homogenisation::{
    CHOICES, ChildPair, Excess, GlobalHomogenisation, Homogenisation, Kharevych, Laminate, Linear,
    Paper, ParentMaterial, by_name,
};
pub use mass::Mass;
pub use materials::{MaterialOfVoxel, Materials};
pub use packed::Packed6;
pub use ring::{Halved, RingPart, RingStiffness};
