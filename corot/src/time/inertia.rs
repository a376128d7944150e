//! What inertia adds to the internal forces of a step.

use nalgebra::{Matrix4, Vector3};
use yawara_embed::Mass;
use yawara_mesh::TetId;

use super::integrator::{TimeIntegrator, TimeStep, VertexMotion};
use crate::body::Body;
use crate::element::Element;
use crate::field::Field;
use crate::forces::InternalForces;

/// The inertia of a body in a step: the forces c M (x − x̃).
#[derive(Clone, Debug)]
pub struct Inertia {
    mass: Mass,
    mass_per_s2: f64,
    /// x̃ by vertex number, m.
    predicted: Vec<Vector3<f64>>,
    /// By element number.
    kilograms: Vec<f64>,
}

impl Inertia {
    /// That of a step of `integrator` from `start`, the motion by vertex number; `density` by
    /// tetrahedron, kg/m³. `None` if the integrator knows no inertia. Elements of `body` must not
    /// change before the step's end.
    ///
    /// Cost: O(elements).
    pub fn new(
        integrator: &dyn TimeIntegrator,
        step: &TimeStep,
        mass: Mass,
        body: &Body,
        start: impl Iterator<Item = VertexMotion>,
        density: impl Fn(TetId) -> f64,
    ) -> Option<Self> {
        let mass_per_s2 = integrator.mass_per_s2(step)?;
        let predicted = start.map(|motion| integrator.predict(step, &motion)).collect();
        let kilograms = |element: &Element| element.geometry.volume * density(element.tet);
        let kilograms = body.elements().iter().map(kilograms).collect();
        Some(Self { mass, mass_per_s2, predicted, kilograms })
    }

    /// x̃ by vertex number, m: where each vertex would go by itself.
    pub fn predicted(&self) -> &Field {
        &self.predicted
    }

    /// c M of element `number` on its corners, the same for each axis, N/m.
    pub fn matrix(&self, number: usize) -> Matrix4<f64> {
        self.mass.matrix(self.kilograms[number]) * self.mass_per_s2
    }

    /// A bound on the entries of c M, N/m.
    pub fn stiffness_scale(&self) -> f64 {
        self.mass_per_s2 * self.kilograms.iter().copied().fold(0.0, f64::max)
    }

    /// Adds c M (x − x̃) to `forces`; returns Σ_e ‖·‖² of the elements' shares.
    pub fn add_to(&self, body: &Body, positions: &Field, forces: &mut Field) -> f64 {
        let mut squares = 0.0;
        for (element, kilograms) in body.elements().iter().zip(&self.kilograms) {
            let corner = self.mass_per_s2 * kilograms;
            let off = element.vertices.map(|v| positions[v] - self.predicted[v]);
            let (own, shared) = match self.mass {
                Mass::Consistent => (corner / 20.0, off.iter().sum::<Vector3<f64>>()),
                Mass::Lumped => (0.25 * corner, Vector3::zeros()),
            };
            for (v, off) in element.vertices.into_iter().zip(off) {
                let force = own * (off + shared);
                squares += force.norm_squared();
                forces[v] += force;
            }
        }
        squares
    }
}

/// f_int(x) with elastic grips and the inertia of the step, if there are any, into `forces` (N,
/// overwritten). Returns √Σ_e ‖f_e‖², as [`InternalForces::internal_forces`] does.
pub fn forces_with_inertia(
    internal: &dyn InternalForces,
    inertia: Option<&Inertia>,
    body: &mut Body,
    positions: &Field,
    forces: &mut Field,
) -> f64 {
    let elastic = internal.internal_forces(body, positions, forces);
    if inertia.is_none() && body.grips().is_empty() {
        return elastic;
    }
    let held: f64 = body.grips().iter().map(|grip| grip.add_to(positions, forces)).sum();
    let inertial = inertia.map_or(0.0, |inertia| inertia.add_to(body, positions, forces));
    (elastic * elastic + held + inertial).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ConstitutiveLaw, ElementCorotation, ImplicitEuler, Rayleigh};
    use nalgebra::Rotation3;
    use std::sync::Arc;
    use yawara_embed::isotropic;

    const STEP_S: f64 = 0.1;
    const DENSITY_KG_M3: f64 = 12.0;

    /// A tetrahedron with damping by stiffness β at the start of a step.
    fn body(beta: f64) -> (Body, [Vector3<f64>; 4]) {
        let law: Arc<dyn ConstitutiveLaw> = Arc::new(Rayleigh::new(beta).unwrap());
        let (mut body, rest) = Body::new().with_law(law).of_one(isotropic(1e3, 0.3));
        body.begin_step(STEP_S);
        (body, rest)
    }

    /// The forces at the end of a step from rest positions and one velocity, with damping by mass α
    /// and by stiffness β.
    fn forces(
        mass: Mass,
        [alpha, beta]: [f64; 2],
        velocity: Vector3<f64>,
        end: impl Fn(Vector3<f64>) -> Vector3<f64>,
    ) -> [Vector3<f64>; 4] {
        let ((mut body, rest), mut forces) = (body(beta), [Vector3::zeros(); 4]);
        let step = TimeStep { length_s: STEP_S, damping_mass_per_s: alpha };
        let acceleration = Vector3::zeros();
        let start = rest.map(|position| VertexMotion { position, velocity, acceleration });
        let (start, density) = (start.into_iter(), |_| DENSITY_KG_M3);
        let inertia = Inertia::new(&ImplicitEuler, &step, mass, &body, start, density);
        let end = rest.map(end);
        forces_with_inertia(&ElementCorotation, inertia.as_ref(), &mut body, &end, &mut forces);
        forces
    }

    #[test]
    fn a_body_that_moves_on_feels_only_damping_by_mass() {
        let v = Vector3::new(0.3, -0.2, 0.7);
        let kg = DENSITY_KG_M3 * body(0.0).0.elements()[0].geometry.volume;
        for mass in [Mass::Consistent, Mass::Lumped] {
            for alpha in [0.0, 2.0] {
                for f in forces(mass, [alpha, 0.2], v, |x| x + STEP_S * v) {
                    assert!((f - alpha * 0.25 * kg * v).norm() < 1e-10, "{f}");
                }
            }
        }
    }

    #[test]
    fn damping_by_stiffness_resists_stretching_and_lets_turning_be() {
        let turn = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.5, -0.2));
        let ((mut bare, rest), mut elastic) = (body(0.0), [Vector3::zeros(); 4]);
        ElementCorotation.internal_forces(&mut bare, &rest.map(|x| x * 1.01), &mut elastic);
        let with = |beta, end: &dyn Fn(Vector3<f64>) -> Vector3<f64>| {
            forces(Mass::Consistent, [0.0, beta], Vector3::zeros(), end)
        };
        let [stretched, damped] = [0.0, 0.3].map(|beta| with(beta, &|x| x * 1.01));
        let [turned, as_turned] = [0.0, 0.3].map(|beta| with(beta, &|x| turn * x));
        for i in 0..4 {
            // The strain has grown from nothing to ε in a step: β/h = 3 times its force.
            assert!((damped[i] - stretched[i] - 3.0 * elastic[i]).norm() < 1e-9, "{i}");
            assert!((as_turned[i] - turned[i]).norm() < 1e-9, "{i}");
        }
    }
}
