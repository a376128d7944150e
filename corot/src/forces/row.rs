//! `row`: one rotation per vertex, applied to the rows of K.

use nalgebra::Matrix3;

use super::internal_forces::InternalForces;
use crate::body::Body;
use crate::field::Field;

/// f_i = R_i Σ_j K_ij (R_iᵀ x_j − X_j), R_i the rotation of vertex i. Invariant to rotation and
/// translation, but the two ends of an edge see different rotations: forces do not balance (ghost
/// forces).
///
/// Within an element, corner i has the displacement gradient R_iᵀF − I, so that no rest position
/// is needed. Source: Müller, Dorsey, McMillan, Jagnow, Cutler, Stable Real-Time Deformations,
/// SCA 2002.
#[derive(Clone, Copy, Debug, Default)]
pub struct RowCorotation;

impl InternalForces for RowCorotation {
    fn name(&self) -> &'static str {
        "row"
    }

    fn internal_forces(&self, body: &mut Body, positions: &Field, forces: &mut Field) -> f64 {
        body.forces_of_corners(positions, forces, |element, rotations| {
            let f = element.deformation_gradient(positions);
            std::array::from_fn(|i| {
                let r = &rotations[element.vertices[i]];
                let gradient = r.transpose() * f - Matrix3::identity();
                element.scaled_stress(r, &gradient) * element.geometry.gradients[i]
            })
        })
    }
}
