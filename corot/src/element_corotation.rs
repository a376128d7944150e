//! `element`: one rotation per element.

use nalgebra::{Matrix3, Vector3};
use yawara_embed::{Strain, strain_from_gradient};

use crate::Corotation;
use crate::body::Body;

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

impl Corotation for ElementCorotation {
    fn name(&self) -> &'static str {
        "element"
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
            let strain = strain_from_gradient(&(r.transpose() * f - Matrix3::identity()));
            let stress = stress_matrix(&(element.elasticity * strain));
            let scaled = r * stress * element.geometry.volume;
            for (v, g) in element.vertices.iter().zip(&element.geometry.gradients) {
                let force = scaled * g;
                squares += force.norm_squared();
                forces[*v] += force;
            }
        });
        body.renew_vertices();
        squares.sqrt()
    }
}

/// The symmetric matrix of a stress in Voigt order xx yy zz xy yz zx.
fn stress_matrix(s: &Strain) -> Matrix3<f64> {
    Matrix3::new(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2])
}
