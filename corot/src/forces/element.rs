//! `element`: one rotation per element.

use super::internal_forces::InternalForces;
use super::tangent::{TangentOf, element_tangent};
use crate::body::Body;
use crate::field::Field;

/// f_int = Σ_e R_e K_e (R_eᵀx_e − X_e), R_e the rotation nearest to the element's deformation
/// gradient, and what makes them the derivative of ½ Σ_e V ε:D:ε, ε = sym(RᵀF) − I, where D is anisotropic.
/// Free of net force and of net torque to rounding.
///
/// With σ = D ε and S = RᵀF the force on corner i is V R (σ − b×) ∇λ_i, b = (tr(S)I − S)⁻¹ axial(σ S), axial that
/// of the skew part times two. b is zero where σ and S commute, as they do for an isotropic D, and else of
/// second order in the strain. It is bounded where det(tr(S)I − S) falls below 10⁻³ tr(S)³: R jumps there.
/// Source: Müller and Gross, Interactive Virtual Materials, Graphics Interface 2004, which leaves b out. (The
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
