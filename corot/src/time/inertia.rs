//! What inertia adds to the internal forces of a step.

use nalgebra::{Matrix4, Vector3};
use yawara_embed::Mass;
use yawara_mesh::TetId;

use super::integrator::{TimeIntegrator, TimeStep, VertexMotion};
use crate::body::Body;
use crate::element::Element;
use crate::forces::InternalForces;

/// The inertia of a body in a step: the forces c M (x − x̃).
#[derive(Clone, Debug)]
pub struct Inertia {
    mass: Mass,
    mass_per_s2: f64,
    /// x̃ by vertex number, m.
    predicted: Vec<Vector3<f64>>,
    /// By tetrahedron number, kg/m³.
    densities: Vec<f64>,
    heaviest: f64,
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
        let mass_per_s2 = integrator.weights(step)?.mass_per_s2;
        let predicted = start.map(|motion| integrator.predict(step, &motion)).collect();
        let last = body.elements().iter().map(|e| e.tet.index()).max();
        let mut densities = vec![0.0; last.map_or(0, |last| last + 1)];
        let mut heaviest: f64 = 0.0;
        for element in body.elements() {
            let rho = density(element.tet);
            densities[element.tet.index()] = rho;
            heaviest = heaviest.max(rho * element.geometry.volume);
        }
        Some(Self { mass, mass_per_s2, predicted, densities, heaviest })
    }

    /// x̃ by vertex number, m: where each vertex would go by itself.
    pub fn predicted(&self) -> &[Vector3<f64>] {
        &self.predicted
    }

    /// c M of an element on its corners, the same for each axis, N/m.
    pub fn matrix(&self, element: &Element) -> Matrix4<f64> {
        self.mass.matrix(self.kilograms(element)) * self.mass_per_s2
    }

    /// A bound on the entries of c M, N/m.
    pub fn stiffness_scale(&self) -> f64 {
        self.mass_per_s2 * self.heaviest
    }

    fn kilograms(&self, element: &Element) -> f64 {
        let density = self.densities.get(element.tet.index()).copied();
        element.geometry.volume * density.unwrap_or(0.0)
    }

    /// Adds c M (x − x̃) to `forces`; returns Σ_e ‖·‖² of the elements' shares.
    pub fn add_to(
        &self,
        body: &Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        let mut squares = 0.0;
        for element in body.elements() {
            let corner = self.mass_per_s2 * self.kilograms(element);
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
    positions: &[Vector3<f64>],
    forces: &mut [Vector3<f64>],
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
    use crate::{ElementCorotation, ImplicitEuler, Rayleigh};
    use nalgebra::{Matrix3, Rotation3};
    use std::sync::Arc;
    use yawara_embed::{LinearTet, isotropic};

    const CORNERS: [[f64; 3]; 4] =
        [[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.0, 0.9, 0.1], [0.2, 0.1, 1.1]];

    /// A tetrahedron with damping by stiffness β that begins a step of 0.1 s.
    fn body(beta: f64) -> (Body, Vec<Vector3<f64>>) {
        let x: Vec<Vector3<f64>> = CORNERS.map(Vector3::from).to_vec();
        let law: Arc<dyn crate::ConstitutiveLaw> = Arc::new(Rayleigh::new(beta).unwrap());
        let mut body = Body::new().with_law(law);
        body.insert(Element {
            tet: TetId(3),
            vertices: [0, 1, 2, 3],
            geometry: LinearTet::new(&CORNERS.map(Vector3::from)),
            elasticity: isotropic(1e3, 0.3),
            rotation: Matrix3::identity(),
        });
        body.begin_step(0.1);
        (body, x)
    }

    fn inertia(mass: Mass, alpha: f64, velocity: Vector3<f64>) -> Inertia {
        let (body, x) = body(0.0);
        let step = TimeStep { length_s: 0.1, damping_mass_per_s: alpha };
        let start = x.into_iter().map(|position| VertexMotion {
            position,
            velocity,
            acceleration: Vector3::zeros(),
        });
        Inertia::new(&ImplicitEuler, &step, mass, &body, start, |_| 12.0).unwrap()
    }

    fn forces(inertia: &Inertia, body: &mut Body, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); 4];
        forces_with_inertia(&ElementCorotation, Some(inertia), body, x, &mut forces);
        forces
    }

    #[test]
    fn a_body_that_moves_on_feels_only_damping_by_mass() {
        let v = Vector3::new(0.3, -0.2, 0.7);
        for mass in [Mass::Consistent, Mass::Lumped] {
            let (mut body, x) = body(0.2);
            let moved: Vec<_> = x.iter().map(|x| x + 0.1 * v).collect();
            let still = forces(&inertia(mass, 0.0, v), &mut body, &moved);
            assert!(still.iter().all(|f| f.norm() < 1e-10), "{still:?}");
            let kg = 12.0 * body.elements()[0].geometry.volume;
            for f in forces(&inertia(mass, 2.0, v), &mut body, &moved) {
                assert!((f - 2.0 * 0.25 * kg * v).norm() < 1e-10, "{f}");
            }
        }
    }

    #[test]
    fn damping_by_stiffness_resists_stretching_and_lets_turning_be() {
        let ((mut bare, x), (mut damped, _)) = (body(0.0), body(0.3));
        let stretched: Vec<_> = x.iter().map(|x| x * 1.01).collect();
        let turn = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.5, -0.2));
        let turned: Vec<_> = x.iter().map(|x| turn * x).collect();
        let inertia = inertia(Mass::Consistent, 0.0, Vector3::zeros());
        let mut elastic = vec![Vector3::zeros(); 4];
        ElementCorotation.internal_forces(&mut bare, &stretched, &mut elastic);
        // The strain has grown from nothing to ε in a step: β/h = 3 times its force.
        let without = forces(&inertia, &mut bare, &stretched);
        let with = forces(&inertia, &mut damped, &stretched);
        for i in 0..4 {
            assert!((with[i] - without[i] - 3.0 * elastic[i]).norm() < 1e-9, "{i}");
        }
        let without = forces(&inertia, &mut bare, &turned);
        let with = forces(&inertia, &mut damped, &turned);
        (0..4).for_each(|i| assert!((with[i] - without[i]).norm() < 1e-9, "{i}"));
    }
}
