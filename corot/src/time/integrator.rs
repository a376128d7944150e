//! The stage that turns a step of motion into a static problem.

use nalgebra::Vector3;

/// A step in time, and the damping by mass during it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeStep {
    /// Its length h, s.
    pub length_s: f64,
    /// α of the damping force α M v, 1/s.
    pub damping_mass_per_s: f64,
}

/// How a vertex moves at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexMotion {
    /// x, m.
    pub position: Vector3<f64>,
    /// v, m/s.
    pub velocity: Vector3<f64>,
    /// a, m/s²; kept from step to step for integrators that
    /// [use it](TimeIntegrator::uses_accelerations), else zero at every start.
    pub acceleration: Vector3<f64>,
}

/// How positions at the end of a step follow from motion at its start.
///
/// Whatever it is, the step is the static problem f_int(x') + c M (x' − x̃) = f_ext: c comes from
/// [`mass_per_s2`](Self::mass_per_s2), x̃ from [`predict`](Self::predict), and [`finish`](Self::finish)
/// gives velocity and acceleration at the end from x'. Damping by stiffness belongs to the
/// [law](crate::ConstitutiveLaw).
///
/// Vertices that are held go through [`finish`](Self::finish) too. A path with a kink (a grab that
/// starts at full speed) leaves a velocity and an acceleration that ring in an integrator without
/// damping, and come free when the tool lets go: let a body swing from a load or a velocity instead.
///
/// `sim/examples/own_integrator.rs` is one of one's own, Newmark's with average acceleration.
pub trait TimeIntegrator: Send + Sync {
    /// The scene name.
    fn name(&self) -> &str;

    /// Whether it asks for the acceleration at the start of a step.
    fn uses_accelerations(&self) -> bool {
        false
    }

    /// c of the step, 1/s²; `None` where there is no inertia.
    fn mass_per_s2(&self, step: &TimeStep) -> Option<f64>;

    /// x̃: the position at the end of the step at which inertia and damping by mass give no force,
    /// m.
    fn predict(&self, step: &TimeStep, start: &VertexMotion) -> Vector3<f64>;

    /// The motion at the end of a step that leads to position `end` (m).
    fn finish(&self, step: &TimeStep, start: &VertexMotion, end: Vector3<f64>) -> VertexMotion;
}
