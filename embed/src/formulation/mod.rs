//! The unknowns of a tetrahedron and its matrices: the swappable element.

mod dynamic;
mod p1;
mod p1p1;

use faer::Mat;
use nalgebra::{Matrix6, Vector3};
use yawara_mesh::{MeshDelta, VertexId};

use crate::element::LinearTet;
use crate::embedding::Embedding;
use crate::error::EmbedError;
use crate::ring::RingStiffness;

pub use dynamic::{Dynamic, EulerWeights, dynamic_by_name};
pub use p1::P1;
pub use p1p1::{MixedModuli, P1P1};

/// What a tetrahedron's vertices carry, and the symmetric matrix that couples them.
///
/// Unknowns are vertex-major: three displacements x, y, z first, others behind them. One file per
/// element; [`formulation_by_name`] makes them by name.
pub trait ElementFormulation: Send + Sync {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Unknowns m per vertex: 3 displacements and what comes behind them.
    fn unknowns(&self) -> usize;

    /// How many of them, at the end, have negative pivots: 0 for a positive definite matrix.
    fn negative(&self) -> usize;

    /// The element's matrix on its four corners, 4m × 4m, symmetric; N/m.
    ///
    /// `elasticity` has to be symmetric positive definite (Pa); another one gives NaN, which every
    /// assembly refuses. Cost: some thousand flops.
    fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64>;

    /// The matrix that the inverse is of, in the same unknowns: the stiffness, and what else the
    /// element has of `density_kg_m3`; N/m.
    fn matrix(
        &self,
        geometry: &LinearTet,
        elasticity: &Matrix6<f64>,
        density_kg_m3: f64,
    ) -> Mat<f64> {
        let _ = density_kg_m3;
        self.stiffness(geometry, elasticity)
    }

    /// The hand-over of a split or merge to the inverse; `position` gives rest positions (m) of
    /// old vertices.
    ///
    /// Cost: some thousand flops per ring tetrahedron.
    fn ring(
        &self,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness;
}

/// Scene names of the built-in elements.
pub const FORMULATIONS: &[&str] = &["p1", "p1p1"];

/// A built-in element, `p1p1` with its own choice of stabilisation.
///
/// # Errors
/// [`EmbedError::UnknownFormulation`] listing the choices.
pub fn formulation_by_name(name: &str) -> Result<Box<dyn ElementFormulation>, EmbedError> {
    match name {
        "p1" => Ok(Box::new(P1)),
        "p1p1" => Ok(Box::new(P1P1::default())),
        _ => Err(EmbedError::UnknownFormulation { name: name.to_owned(), choices: FORMULATIONS }),
    }
}
