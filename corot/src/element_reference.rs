//! Element co-rotation, one element after the other.

use nalgebra::{Matrix3, Vector3};

use crate::Corotation;
use crate::body::{Body, Element};
use crate::stress::{add_forces, scaled_stress};
use crate::tangent::{ElementTangent, element_tangent};

/// [`ElementCorotation`](crate::ElementCorotation) without vector kernels: slow and obvious, what
/// those are tested against. Cost: about ten times theirs.
#[derive(Clone, Copy, Debug, Default)]
pub struct ElementReference;

impl Corotation for ElementReference {
    fn name(&self) -> &'static str {
        "element_reference"
    }

    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        forces.fill(Vector3::zeros());
        let mut squares = 0.0;
        body.renew_elements(positions, |element, f| {
            let r = &element.rotation;
            let scaled = scaled_stress(element, r, &(r.transpose() * f - Matrix3::identity()));
            squares += add_forces(element, &scaled, forces);
        });
        body.renew_vertices();
        squares.sqrt()
    }

    fn tangent(&self, element: &Element, positions: &[Vector3<f64>]) -> Option<ElementTangent> {
        Some(element_tangent(element, positions))
    }
}
