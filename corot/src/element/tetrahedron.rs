//! One linear tetrahedron of a body.

use nalgebra::{Matrix3, Matrix6};
use yawara_embed::{LinearTet, Strain, strain_from_gradient};
use yawara_mesh::TetId;

use crate::field::Field;

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
}

impl Element {
    /// Deformation gradient F = Σ x_i ⊗ ∇λ_i.
    pub fn deformation_gradient(&self, positions: &Field) -> Matrix3<f64> {
        self.geometry.gradient(&self.vertices.map(|v| positions[v]))
    }

    /// Strain of the co-rotated displacement Rᵀx − X: sym(RᵀF) − I.
    pub fn corotated_strain(&self, rotation: &Matrix3<f64>, positions: &Field) -> Strain {
        let f = self.deformation_gradient(positions);
        strain_from_gradient(&(rotation.transpose() * f - Matrix3::identity()))
    }

    /// V R σ(sym H) for the gradient H of a displacement in the frame of R: times ∇λ_i it is the
    /// force on corner i, N.
    pub(crate) fn scaled_stress(
        &self,
        rotation: &Matrix3<f64>,
        displacement_gradient: &Matrix3<f64>,
    ) -> Matrix3<f64> {
        let strain = strain_from_gradient(displacement_gradient);
        rotation * stress_matrix(&(self.elasticity * strain)) * self.geometry.volume
    }

    /// Adds the forces on its corners, N; returns Σ ‖f_i‖² of them.
    pub(crate) fn add_forces(&self, scaled_stress: &Matrix3<f64>, forces: &mut Field) -> f64 {
        let mut squares = 0.0;
        for (v, g) in self.vertices.iter().zip(&self.geometry.gradients) {
            let force = scaled_stress * g;
            squares += force.norm_squared();
            forces[*v] += force;
        }
        squares
    }
}

/// The symmetric matrix of a stress in Voigt order xx yy zz xy yz zx.
pub(crate) fn stress_matrix(s: &Strain) -> Matrix3<f64> {
    Matrix3::new(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2])
}
