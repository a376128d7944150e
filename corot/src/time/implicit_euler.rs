//! Implicit Euler as a static problem: inertia and damping join the internal forces.

use nalgebra::{SMatrix, Vector3};
use yawara_embed::{EulerWeights, Mass, Strain};
use yawara_mesh::TetId;

use crate::body::Body;
use crate::element::Element;
use crate::element::stress::{add_forces, stress_matrix};
use crate::forces::InternalForces;
use crate::forces::tangent::ElementTangent;

/// What a step of implicit Euler knows of its start.
///
/// With v' = (x' − x)/h in M (v' − v)/h + α M v' + f_int(x') + f_β = f_ext, the step is
/// f_int(x') + f_β + c M (x' − x̃) = f_ext, c = 1/h² + α/h, x̃ = x + v/(h c).
/// f_β = (β/h) Σ_e R_e V BᵀD (ε' − ε): the damping sees how the strain of Rᵀx − X has changed, so
/// that a body that only turns is not damped by it.
#[derive(Clone, Debug)]
pub struct EulerStep {
    weights: EulerWeights,
    /// x̃ by vertex number, m.
    coasting: Vec<Vector3<f64>>,
    /// By tetrahedron number, kg/m³.
    densities: Vec<f64>,
    /// ε at the start by element; empty without damping by stiffness.
    strains: Vec<Strain>,
    heaviest: f64,
}

impl EulerStep {
    /// The step of length `step_s` (s) from `positions` (m) and `velocities` (m/s), both by vertex
    /// number; `density` by tetrahedron, kg/m³. The rotations of `body` have to be those of
    /// `positions`; its elements must not change before the step's end.
    ///
    /// Cost: O(elements).
    pub fn new(
        weights: EulerWeights,
        step_s: f64,
        body: &Body,
        positions: &[Vector3<f64>],
        velocities: &[Vector3<f64>],
        density: impl Fn(TetId) -> f64,
    ) -> Self {
        let ahead = 1.0 / (step_s * weights.mass_per_s2);
        let coasting = positions.iter().zip(velocities).map(|(x, v)| x + ahead * v).collect();
        let elements = body.elements().iter();
        let last = elements.clone().map(|e| e.tet.index()).max();
        let mut densities = vec![0.0; last.map_or(0, |last| last + 1)];
        let mut heaviest: f64 = 0.0;
        for element in elements.clone() {
            let rho = density(element.tet);
            densities[element.tet.index()] = rho;
            heaviest = heaviest.max(rho * element.geometry.volume);
        }
        let strains = match weights.stiffness > 1.0 {
            true => elements.map(|e| e.corotated_strain(positions)).collect(),
            false => Vec::new(),
        };
        Self { weights, coasting, densities, strains, heaviest }
    }

    /// x̃ by vertex number, m: where each vertex would go by itself.
    pub fn coasting(&self) -> &[Vector3<f64>] {
        &self.coasting
    }

    fn mass(&self, element: &Element) -> f64 {
        let density = self.densities.get(element.tet.index()).copied();
        element.geometry.volume * density.unwrap_or(0.0)
    }

    /// Adds c M (x − x̃) to `forces`; returns Σ_e ‖·‖² of the elements' shares.
    fn add_inertia(
        &self,
        body: &Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        let mut squares = 0.0;
        for element in body.elements() {
            let corner = self.weights.mass_per_s2 * self.mass(element);
            let off = element.vertices.map(|v| positions[v] - self.coasting[v]);
            let (own, shared) = match self.weights.mass {
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

    /// Adds f_β to `forces`; returns Σ_e ‖·‖² of the elements' shares.
    fn add_damping(
        &self,
        body: &Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        let weight = self.weights.stiffness - 1.0;
        let mut squares = 0.0;
        for (element, before) in body.elements().iter().zip(&self.strains) {
            let change = element.corotated_strain(positions) - before;
            let stress = stress_matrix(&(element.elasticity * change));
            let scaled = element.rotation * stress * (weight * element.geometry.volume);
            squares += add_forces(element, &scaled, forces);
        }
        squares
    }
}

/// The forces of a co-rotation with those of inertia and damping: what a solver brings into
/// balance with the loads is then a step of implicit Euler.
///
/// On vertices that are held, what is left is the force that moves them, inertia included.
pub struct ImplicitEuler<'a> {
    forces: &'a dyn InternalForces,
    step: &'a EulerStep,
}

impl<'a> ImplicitEuler<'a> {
    /// `step` from a body whose forces are those of `forces`.
    pub fn new(forces: &'a dyn InternalForces, step: &'a EulerStep) -> Self {
        Self { forces, step }
    }
}

impl InternalForces for ImplicitEuler<'_> {
    fn name(&self) -> &'static str {
        self.forces.name()
    }

    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64 {
        let elastic = self.forces.internal_forces(body, positions, forces);
        let inertial = self.step.add_inertia(body, positions, forces);
        let damping = self.step.add_damping(body, positions, forces);
        (elastic * elastic + inertial + damping).sqrt()
    }

    /// That of the co-rotation, c M, and of the damping (β/h) R K Rᵀ: without what the turning of
    /// its stress would add, which is of the order of the strain's change.
    fn tangent(&self, element: &Element, positions: &[Vector3<f64>]) -> Option<ElementTangent> {
        let mut tangent = self.forces.tangent(element, positions)?;
        let EulerWeights { mass, mass_per_s2, stiffness } = self.step.weights;
        let mass = mass.matrix(self.step.mass(element)) * mass_per_s2;
        let damping = if stiffness > 1.0 {
            element.geometry.stiffness(&element.elasticity) * (stiffness - 1.0)
        } else {
            SMatrix::zeros()
        };
        let r = &element.rotation;
        for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
            let block = damping.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
            let block = r * block * r.transpose() + nalgebra::Matrix3::identity() * mass[(i, j)];
            let mut target = tangent.fixed_view_mut::<3, 3>(3 * i, 3 * j);
            target += block;
        }
        Some(tangent)
    }

    fn carries_pressures(&self) -> bool {
        self.forces.carries_pressures()
    }

    fn stiffness_scale(&self, body: &Body) -> f64 {
        let EulerWeights { mass_per_s2, stiffness, .. } = self.step.weights;
        stiffness * self.forces.stiffness_scale(body) + mass_per_s2 * self.step.heaviest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ElementCorotation;
    use nalgebra::{Matrix3, Rotation3};
    use yawara_embed::{LinearTet, isotropic};

    const CORNERS: [[f64; 3]; 4] =
        [[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.0, 0.9, 0.1], [0.2, 0.1, 1.1]];

    fn body() -> (Body, Vec<Vector3<f64>>) {
        let x: Vec<Vector3<f64>> = CORNERS.map(Vector3::from).to_vec();
        let mut body = Body::new();
        body.insert(Element {
            tet: TetId(3),
            vertices: [0, 1, 2, 3],
            geometry: LinearTet::new(&CORNERS.map(Vector3::from)),
            elasticity: isotropic(1e3, 0.3),
            rotation: Matrix3::identity(),
        });
        (body, x)
    }

    fn step(mass: Mass, alpha: f64, beta: f64, velocity: Vector3<f64>) -> EulerStep {
        let (body, x) = body();
        let weights = EulerWeights::new(mass, 0.1, alpha, beta).unwrap();
        EulerStep::new(weights, 0.1, &body, &x, &[velocity; 4], |_| 12.0)
    }

    fn forces(step: &EulerStep, body: &mut Body, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); 4];
        ImplicitEuler::new(&ElementCorotation, step).internal_forces(body, x, &mut forces);
        forces
    }

    #[test]
    fn a_body_that_moves_on_feels_only_damping_by_mass() {
        let v = Vector3::new(0.3, -0.2, 0.7);
        for mass in [Mass::Consistent, Mass::Lumped] {
            let (mut body, x) = body();
            let moved: Vec<_> = x.iter().map(|x| x + 0.1 * v).collect();
            let still = forces(&step(mass, 0.0, 0.2, v), &mut body, &moved);
            assert!(still.iter().all(|f| f.norm() < 1e-10), "{still:?}");
            let kg = 12.0 * body.elements()[0].geometry.volume;
            for f in forces(&step(mass, 2.0, 0.2, v), &mut body, &moved) {
                assert!((f - 2.0 * 0.25 * kg * v).norm() < 1e-10, "{f}");
            }
        }
    }

    #[test]
    fn damping_by_stiffness_resists_stretching_and_lets_turning_be() {
        let (mut body, x) = body();
        let stretched: Vec<_> = x.iter().map(|x| x * 1.01).collect();
        let turn = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.5, -0.2));
        let turned: Vec<_> = x.iter().map(|x| turn * x).collect();
        let zero = Vector3::zeros();
        let (bare, damped) =
            (step(Mass::Consistent, 0.0, 0.0, zero), step(Mass::Consistent, 0.0, 0.3, zero));
        let mut elastic = vec![zero; 4];
        ElementCorotation.internal_forces(&mut body, &stretched, &mut elastic);
        // The strain has grown from nothing to ε in a step: β/h = 3 times its force.
        let without = forces(&bare, &mut body, &stretched);
        let with = forces(&damped, &mut body, &stretched);
        for i in 0..4 {
            assert!((with[i] - without[i] - 3.0 * elastic[i]).norm() < 1e-9, "{i}");
        }
        let without = forces(&bare, &mut body, &turned);
        let with = forces(&damped, &mut body, &turned);
        (0..4).for_each(|i| assert!((with[i] - without[i]).norm() < 1e-9, "{i}"));
    }

    #[test]
    fn the_tangent_is_the_derivative_without_damping() {
        for mass in [Mass::Consistent, Mass::Lumped] {
            let step = step(mass, 1.5, 0.0, Vector3::new(1.0, 0.0, 0.5));
            let (mut body, mut x) = body();
            x[1] += Vector3::new(0.05, 0.1, -0.02);
            forces(&step, &mut body, &x);
            let euler = ImplicitEuler::new(&ElementCorotation, &step);
            let tangent = euler.tangent(&body.elements()[0], &x).unwrap();
            let h = 1e-6;
            for column in 0..12 {
                let at = x[column / 3][column % 3];
                x[column / 3][column % 3] = at + h;
                let up = forces(&step, &mut body, &x);
                x[column / 3][column % 3] = at - h;
                let down = forces(&step, &mut body, &x);
                x[column / 3][column % 3] = at;
                for row in 0..12 {
                    let slope = (up[row / 3][row % 3] - down[row / 3][row % 3]) / (2.0 * h);
                    let off = (slope - tangent[(row, column)]).abs();
                    assert!(off < 1e-6 * tangent.amax(), "({row}, {column}): {off}");
                }
            }
        }
    }
}
