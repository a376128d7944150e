//! The stage from positions to internal forces.

use nalgebra::Vector3;

use super::tangent::ElementTangent;
use crate::body::Body;

/// How internal forces follow from positions.
///
/// One that is a choice of each element's rotation calls
/// [`Body::forces_with_rotations`], which does all the rest; `sim/examples/own_forces.rs` does so.
/// The rotations that it leaves in the body are read by solvers (they turn the inverse with the
/// vertices), by stresses, by indicators and by output.
pub trait InternalForces: Send + Sync {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Adds nothing, overwrites `forces` with f_int(x) (N, one per vertex number) and renews the
    /// rotations of `body`. Returns √Σ_e ‖f_e‖², the scale against which residuals are measured.
    ///
    /// Cost: O(elements).
    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64;

    /// ∂f_int/∂x of element `number` of `body` at its stored rotation under the body's law, if there
    /// is such a thing. N/m.
    fn tangent(
        &self,
        body: &Body,
        number: usize,
        positions: &[Vector3<f64>],
    ) -> Option<ElementTangent> {
        let _ = (body, number, positions);
        None
    }

    /// Whether it reads the pressures of a [mixed](Body::mixed) body; without it they stay out of
    /// its forces.
    fn carries_pressures(&self) -> bool {
        false
    }

    /// A bound on the entries of ∂f_int/∂x, N/m: what rounding of positions does to forces goes
    /// with it.
    fn stiffness_scale(&self, body: &Body) -> f64 {
        body.stiffness_scale()
    }
}
