//! `newmark`: second order, stable for any step, damps nothing.

use nalgebra::Vector3;

use super::integrator::{TimeIntegrator, TimeStep, VertexMotion};

/// Average acceleration (β = ¼, γ = ½): a' = 4u/h² − 4v/h − a and v' = 2u/h − v with u = x' − x. With these
/// M a' + α M v' is c M (x' − x̃), c = 4/h² + 2α/h, x̃ = x + ((4/h + α) v + a)/c.
///
/// Its periods are longer by (ωh)²/12. What steps do not resolve goes on ringing: prefer `implicit_euler` where tools
/// grab and let go.
/// # Source
/// Newmark, A method of computation for structural dynamics, J. Eng. Mech. Div. 85(3), 1959.
#[derive(Clone, Copy, Debug, Default)]
pub struct Newmark;

fn weight(step: &TimeStep) -> f64 {
    (4.0 / step.length_s + 2.0 * step.damping_mass_per_s) / step.length_s
}

impl TimeIntegrator for Newmark {
    fn name(&self) -> &str {
        "newmark"
    }

    fn uses_accelerations(&self) -> bool {
        true
    }

    fn mass_per_s2(&self, step: &TimeStep) -> Option<f64> {
        Some(weight(step))
    }

    fn predict(&self, step: &TimeStep, start: &VertexMotion) -> Vector3<f64> {
        let ahead = (4.0 / step.length_s + step.damping_mass_per_s) * start.velocity;
        start.position + (ahead + start.acceleration) / weight(step)
    }

    fn finish(&self, step: &TimeStep, start: &VertexMotion, end: Vector3<f64>) -> VertexMotion {
        let h = step.length_s;
        let velocity = 2.0 * (end - start.position) / h - start.velocity;
        let acceleration = 2.0 * (velocity - start.velocity) / h - start.acceleration;
        VertexMotion { position: end, velocity, acceleration }
    }
}
