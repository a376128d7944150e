//! `implicit_euler`: first order, stable for any step, damps what is fast.

use nalgebra::Vector3;

use super::integrator::{TimeIntegrator, TimeStep, VertexMotion};

/// v' = (x' − x)/h. With it M (v' − v)/h + α M v' is c M (x' − x̃), c = 1/h² + α/h,
/// x̃ = x + v/(h c).
#[derive(Clone, Copy, Debug, Default)]
pub struct ImplicitEuler;

fn weight(step: &TimeStep) -> f64 {
    (1.0 / step.length_s + step.damping_mass_per_s) / step.length_s
}

impl TimeIntegrator for ImplicitEuler {
    fn name(&self) -> &str {
        "implicit_euler"
    }

    fn mass_per_s2(&self, step: &TimeStep) -> Option<f64> {
        Some(weight(step))
    }

    fn predict(&self, step: &TimeStep, start: &VertexMotion) -> Vector3<f64> {
        let ahead = 1.0 / (step.length_s * weight(step));
        start.position + ahead * start.velocity
    }

    fn finish(&self, step: &TimeStep, start: &VertexMotion, end: Vector3<f64>) -> VertexMotion {
        let velocity = (end - start.position) / step.length_s;
        let acceleration = (velocity - start.velocity) / step.length_s;
        VertexMotion { position: end, velocity, acceleration }
    }
}
