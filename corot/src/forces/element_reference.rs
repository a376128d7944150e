//! Element co-rotation, one element after the other.

use super::internal_forces::InternalForces;
use super::tangent::{TangentOf, element_tangent};
use crate::body::Body;
use crate::element::turning::Turning;
use crate::field::Field;

/// [`ElementCorotation`](crate::ElementCorotation) without vector kernels: slow and obvious, what
/// those are tested against. Cost: about ten times theirs.
#[derive(Clone, Copy, Debug, Default)]
pub struct ElementReference;

impl InternalForces for ElementReference {
    fn name(&self) -> &'static str {
        "element_reference"
    }

    fn internal_forces(&self, body: &mut Body, positions: &Field, forces: &mut Field) -> f64 {
        body.renew_rotations(positions);
        body.forces_as_turned(positions, forces, Turning::Nearest)
    }

    fn carries_pressures(&self) -> bool {
        true
    }

    fn tangent(&self) -> Option<TangentOf<'_>> {
        Some(Box::new(element_tangent))
    }
}
