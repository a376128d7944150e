//! One linear tetrahedron of a body.

use nalgebra::{Matrix3, Matrix6, Vector3};
use yawara_embed::{LinearTet, Strain, strain_from_gradient};
use yawara_mesh::TetId;

/// A linear tetrahedron in a [`Body`](crate::Body).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// Its number in the mesh.
    pub tet: TetId,
    /// Its corners' vertex numbers.
    pub vertices: [usize; 4],
    /// Rest geometry.
    pub geometry: LinearTet,
    /// Elasticity, Pa.
    pub elasticity: Matrix6<f64>,
    /// Rotation at the last force evaluation.
    pub rotation: Matrix3<f64>,
}

impl Element {
    /// Deformation gradient F = Σ x_i ⊗ ∇λ_i.
    pub fn deformation_gradient(&self, positions: &[Vector3<f64>]) -> Matrix3<f64> {
        self.geometry.gradient(&self.vertices.map(|v| positions[v]))
    }

    /// Strain of the co-rotated displacement Rᵀx − X under the stored rotation: sym(RᵀF) − I.
    pub fn corotated_strain(&self, positions: &[Vector3<f64>]) -> Strain {
        let f = self.deformation_gradient(positions);
        strain_from_gradient(&(self.rotation.transpose() * f - Matrix3::identity()))
    }
}
