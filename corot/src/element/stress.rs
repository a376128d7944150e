//! From a strain in a rotated frame to the forces on the corners of a linear tetrahedron.

use nalgebra::{Matrix3, Vector3};
use yawara_embed::{Strain, strain_from_gradient};

use super::Element;

/// The symmetric matrix of a stress in Voigt order xx yy zz xy yz zx.
pub(crate) fn stress_matrix(s: &Strain) -> Matrix3<f64> {
    Matrix3::new(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2])
}

/// V R σ(sym H) for the gradient H of a displacement in the frame of R: times ∇λ_i it is the
/// force on corner i, N.
pub(crate) fn scaled_stress(
    element: &Element,
    rotation: &Matrix3<f64>,
    displacement_gradient: &Matrix3<f64>,
) -> Matrix3<f64> {
    let strain = strain_from_gradient(displacement_gradient);
    rotation * stress_matrix(&(element.elasticity * strain)) * element.geometry.volume
}

/// Adds the forces of one element to those of its corners; returns Σ ‖f_i‖² of them.
pub(crate) fn add_forces(
    element: &Element,
    scaled_stress: &Matrix3<f64>,
    forces: &mut [Vector3<f64>],
) -> f64 {
    let mut squares = 0.0;
    for (v, g) in element.vertices.iter().zip(&element.geometry.gradients) {
        let force = scaled_stress * g;
        squares += force.norm_squared();
        forces[*v] += force;
    }
    squares
}
