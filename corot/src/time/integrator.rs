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

/// What inertia weighs in a step: the system's matrix is K + c M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertiaWeights {
    /// c, 1/s².
    pub mass_per_s2: f64,
}

/// How positions at the end of a step follow from motion at its start.
///
/// Whatever it is, the step is the static problem f_int(x') + c M (x' − x̃) = f_ext: c comes from
/// [`weights`](Self::weights), x̃ from [`predict`](Self::predict), and [`finish`](Self::finish)
/// gives velocity and acceleration at the end from x'. Damping by stiffness belongs to the
/// [law](crate::ConstitutiveLaw).
///
/// Vertices that are held go through [`finish`](Self::finish) too. A path with a kink (a grab that
/// starts at full speed) leaves a velocity and an acceleration that ring in an integrator without
/// damping, and come free when the tool lets go: let a body swing from a load or a velocity instead.
///
/// An integrator of one's own, Newmark's with average acceleration (second order, no damping):
/// ```
/// use nalgebra::Vector3;
/// use yawara_corot::{InertiaWeights, TimeIntegrator, TimeStep, VertexMotion};
///
/// struct Newmark;
///
/// impl TimeIntegrator for Newmark {
///     fn name(&self) -> &str {
///         "newmark"
///     }
///     fn uses_accelerations(&self) -> bool {
///         true
///     }
///     fn weights(&self, step: &TimeStep) -> Option<InertiaWeights> {
///         let TimeStep { length_s: h, damping_mass_per_s: alpha } = *step;
///         Some(InertiaWeights { mass_per_s2: (4.0 / h + 2.0 * alpha) / h })
///     }
///     fn predict(&self, step: &TimeStep, start: &VertexMotion) -> Vector3<f64> {
///         // With u = x' − x: a' = 4u/h² − 4v/h − a and v' = 2u/h − v.
///         let TimeStep { length_s: h, damping_mass_per_s: alpha } = *step;
///         let VertexMotion { position, velocity: v, acceleration: a } = start;
///         let c = (4.0 / h + 2.0 * alpha) / h;
///         position + ((4.0 / h + alpha) * v + a) / c
///     }
///     fn finish(&self, step: &TimeStep, start: &VertexMotion, end: Vector3<f64>) -> VertexMotion {
///         let h = step.length_s;
///         let velocity = 2.0 * (end - start.position) / h - start.velocity;
///         let acceleration = 2.0 * (velocity - start.velocity) / h - start.acceleration;
///         VertexMotion { position: end, velocity, acceleration }
///     }
/// }
///
/// let step = TimeStep { length_s: 0.1, damping_mass_per_s: 0.0 };
/// let start = VertexMotion {
///     position: Vector3::zeros(),
///     velocity: Vector3::new(3.0, 0.0, 0.0),
///     acceleration: Vector3::zeros(),
/// };
/// let alone = Newmark.predict(&step, &start);
/// assert!((alone - Vector3::new(0.3, 0.0, 0.0)).norm() < 1e-15);
/// assert!((Newmark.finish(&step, &start, alone).velocity - start.velocity).norm() < 1e-14);
/// ```
pub trait TimeIntegrator: Send + Sync {
    /// The scene name.
    fn name(&self) -> &str;

    /// Whether it asks for the acceleration at the start of a step.
    fn uses_accelerations(&self) -> bool {
        false
    }

    /// c of the step; `None` where there is no inertia.
    fn weights(&self, step: &TimeStep) -> Option<InertiaWeights>;

    /// x̃: the position at the end of the step at which inertia and damping by mass give no force,
    /// m.
    fn predict(&self, step: &TimeStep, start: &VertexMotion) -> Vector3<f64>;

    /// The motion at the end of a step that leads to position `end` (m).
    fn finish(&self, step: &TimeStep, start: &VertexMotion, end: Vector3<f64>) -> VertexMotion;
}
