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

mod detail;
mod element;
mod embedding;
mod error;
mod fine;
mod hand_over;
mod homogenisation;
mod linear_tet;
mod material;
mod parts;

pub use detail::{DetailMesh, Follower, RotationOf};
pub use element::{
    Dynamic, ElementFormulation, FORMULATIONS, Mass, MixedModuli, P1, P1P1, StepWeights,
    dynamic_by_name, formulation_by_name,
};
pub use embedding::{Elasticities, Embedding};
pub use error::EmbedError;
pub use fine::{
    DIRECT_VERTICES, FineBody, FineFields, LdlPattern, SixFields, SparseCholesky, SparseLdl,
};
pub use hand_over::{ContentStiffness, Halved, RingPart, RingStiffness, clamp};
pub use homogenisation::{
    CHOICES, ChildPair, Excess, GlobalHomogenisation, Hierarchical, Homogenisation, Kharevych,
    Laminate, Linear, Paper, ParentMaterial, by_name,
};
pub use linear_tet::{LinearTet, Strain, strain_from_gradient, strain_operator};
pub use material::{
    FineMaterial, Material, MaterialOfVoxel, Materials, Packed6, VoidRule, isotropic,
};
