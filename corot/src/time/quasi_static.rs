//! `quasi_static`: every step ends in equilibrium.

use nalgebra::Vector3;

use super::integrator::{TimeIntegrator, TimeStep, VertexMotion};

/// No inertia: a vertex left alone stays where it is.
#[derive(Clone, Copy, Debug, Default)]
pub struct QuasiStatic;

impl TimeIntegrator for QuasiStatic {
    fn name(&self) -> &str {
        "quasi_static"
    }

    fn mass_per_s2(&self, _: &TimeStep) -> Option<f64> {
        None
    }

    fn predict(&self, _: &TimeStep, start: &VertexMotion) -> Vector3<f64> {
        start.position
    }

    fn finish(&self, _: &TimeStep, _: &VertexMotion, end: Vector3<f64>) -> VertexMotion {
        let zero = Vector3::zeros();
        VertexMotion { position: end, velocity: zero, acceleration: zero }
    }
}
