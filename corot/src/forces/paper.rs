//! `paper`: one rotation per vertex, applied to positions about the origin.

use nalgebra::Matrix3;

use super::internal_forces::InternalForces;
use crate::body::Body;
use crate::field::Field;

/// f = T K (T⁻¹x − X) literally, T the block diagonal of the vertices' rotations:
/// f_i = R_i Σ_j K_ij (R_jᵀ x_j − X_j). Neighbours turn about the origin by different rotations, so
/// that the forces change when the body is moved: by ten to twenty times when by its own length.
/// To first order it takes ω_i × x_i from each displacement u_i, which for a bent body is as large
/// as u_i: with the paper's iteration ([`Direct`](crate::Direct)) a bent beam is lost at any angle.
/// It is here to show that.
///
/// Source: Oishi et al., eq. (2).
#[derive(Clone, Copy, Debug, Default)]
pub struct PaperCorotation;

impl InternalForces for PaperCorotation {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn internal_forces(&self, body: &mut Body, positions: &Field, forces: &mut Field) -> f64 {
        body.forces_of_corners(positions, forces, |element, rotations| {
            let corners = element.vertices.map(|v| rotations[v].transpose() * positions[v]);
            let gradient = element.geometry.gradient(&corners) - Matrix3::identity();
            let stress = element.scaled_stress(&Matrix3::identity(), &gradient);
            std::array::from_fn(|i| {
                rotations[element.vertices[i]] * (stress * element.geometry.gradients[i])
            })
        })
    }
}
