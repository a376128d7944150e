//! `none`: linear elasticity.

use nalgebra::Matrix3;

use super::internal_forces::InternalForces;
use super::tangent::TangentOf;
use crate::body::Body;
use crate::field::Field;

/// f_int = Σ_e K_e (x_e − X_e): all rotations are the identity. Exact for infinitesimal rotation;
/// a body that turns by θ without strain is loaded as if strained by 1 − cos θ.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoCorotation;

impl InternalForces for NoCorotation {
    fn name(&self) -> &'static str {
        "none"
    }

    fn internal_forces(&self, body: &mut Body, positions: &Field, forces: &mut Field) -> f64 {
        body.forces_with_rotations(|_| Matrix3::identity(), positions, forces)
    }

    fn carries_pressures(&self) -> bool {
        true
    }

    fn turns(&self) -> bool {
        false
    }

    fn tangent(&self) -> Option<TangentOf<'_>> {
        Some(Box::new(|body, number, positions| {
            let (_, modulus) = body.response(number, positions);
            body.elements()[number].geometry.stiffness(&modulus)
        }))
    }
}
