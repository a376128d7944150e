//! `none`: linear elasticity.

use nalgebra::{Matrix3, Vector3};

use crate::Corotation;
use crate::body::{Body, Element};
use crate::stress::{add_forces, scaled_stress};
use crate::tangent::ElementTangent;

/// f_int = Σ_e K_e (x_e − X_e): all rotations are the identity. Exact for infinitesimal rotation;
/// a body that turns by θ without strain is loaded as if strained by 1 − cos θ.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoCorotation;

impl Corotation for NoCorotation {
    fn name(&self) -> &'static str {
        "none"
    }

    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        forces.fill(Vector3::zeros());
        body.unrotate(positions.len());
        let mut squares = 0.0;
        for element in body.elements() {
            let f = element.deformation_gradient(positions);
            let identity = Matrix3::identity();
            squares +=
                add_forces(element, &scaled_stress(element, &identity, &(f - identity)), forces);
        }
        squares.sqrt()
    }

    fn tangent(&self, element: &Element, _: &[Vector3<f64>]) -> Option<ElementTangent> {
        Some(element.geometry.stiffness(&element.elasticity))
    }
}
