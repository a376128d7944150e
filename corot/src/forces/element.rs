//! `element`: one rotation per element.

use super::internal_forces::InternalForces;
use super::tangent::{TangentOf, element_tangent};
use crate::body::Body;
use crate::field::Field;

/// f_int = Σ_e R_e K_e (R_eᵀx_e − X_e), R_e the rotation nearest to the element's deformation
/// gradient. Free of net force to rounding, and of net torque for isotropic D; with an
/// anisotropic D the stress does not commute with the stretch, which leaves a torque of second
/// order in the strain.
///
/// With σ = D sym(RᵀF − I), the force on corner i is V R σ ∇λ_i: the same without forming K_e.
/// Source: Müller and Gross, Interactive Virtual Materials, Graphics Interface 2004. (The
/// vertex-wise form of Oishi et al., eq. (2), is not translation invariant.)
#[derive(Clone, Copy, Debug, Default)]
pub struct ElementCorotation;

impl InternalForces for ElementCorotation {
    fn name(&self) -> &'static str {
        "element"
    }

    fn internal_forces(&self, body: &mut Body, positions: &Field, forces: &mut Field) -> f64 {
        body.forces_and_stiffness(positions, forces, &mut [])
    }

    fn carries_pressures(&self) -> bool {
        true
    }

    fn tangent(&self) -> Option<TangentOf<'_>> {
        Some(Box::new(element_tangent))
    }
}
