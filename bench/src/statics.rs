//! A held [`Solid`] with the inverse of its stiffness: what an equilibrium solver works on.

use faer::Mat;
use nalgebra::Vector3;
use yawara_corot::{Body, Equilibrium, InternalForces, Outcome, Problem, Tolerance};
use yawara_embed::{ElementFormulation, P1, P1P1, clamp};
use yawara_inverse_update::{InverseMaintainer, SparseStiffness, build};
use yawara_mesh::Lattice;

use crate::error::BenchError;
use crate::solid::Solid;

/// A body, held at some vertices, on its way through equilibria.
pub struct Statics {
    /// Elements and rotations.
    pub body: Body,
    /// Rest positions by vertex number.
    pub rest: Vec<Vector3<f64>>,
    /// Current positions; those of held vertices are where they are held.
    pub positions: Vec<Vector3<f64>>,
    /// Internal forces at the last solve.
    pub internal: Vec<Vector3<f64>>,
    /// Which vertices are not held.
    pub free: Vec<bool>,
    link: Link,
    element: Box<dyn ElementFormulation>,
}

/// The inverse, and which vertex has which slot in it.
struct Link {
    slots: Vec<usize>,
    vertices: Vec<usize>,
    inverse: Box<dyn InverseMaintainer>,
    /// Unknowns per vertex.
    block: usize,
}

const NO_SLOT: usize = usize::MAX;

impl Statics {
    /// Factors the stiffness of `solid` with the vertices held for which `held` says so.
    ///
    /// # Errors
    /// [`BenchError::Inverse`] if it is not held well enough.
    pub fn new(solid: &Solid, held: impl Fn(&Vector3<f64>) -> bool) -> Result<Self, BenchError> {
        Self::of(solid, held, Box::new(P1), solid.body())
    }

    /// The same with pressures beside displacements.
    ///
    /// # Errors
    /// [`BenchError::Inverse`] if it is not held well enough.
    pub fn mixed(solid: &Solid, held: impl Fn(&Vector3<f64>) -> bool) -> Result<Self, BenchError> {
        let element = P1P1::default();
        Self::of(solid, held, Box::new(element), solid.fill(Body::mixed(element)))
    }

    fn of(
        solid: &Solid,
        held: impl Fn(&Vector3<f64>) -> bool,
        element: Box<dyn ElementFormulation>,
        body: Body,
    ) -> Result<Self, BenchError> {
        let free: Vec<bool> = solid.points.iter().map(|x| !held(x)).collect();
        // A held vertex keeps its pressure, if it has one.
        let vertices: Vec<usize> =
            (0..free.len()).filter(|&v| free[v] || body.is_mixed()).collect();
        let mut slots = vec![NO_SLOT; free.len()];
        vertices.iter().enumerate().for_each(|(slot, &v)| slots[v] = slot);
        let stiffness = stiffness(solid, &body, element.as_ref(), &free, &slots)?;
        let block = element.unknowns();
        let link = Link { slots, vertices, inverse: build("sparse", stiffness)?, block };
        let positions = solid.points.clone();
        let internal = vec![Vector3::zeros(); free.len()];
        Ok(Self { body, rest: positions.clone(), positions, internal, free, link, element })
    }

    /// Solves for the free vertices from where they are.
    ///
    /// `before_inverse` is called with every application of the inverse.
    pub fn solve(
        &mut self,
        corotation: &dyn InternalForces,
        equilibrium: &mut dyn Equilibrium,
        external: &[Vector3<f64>],
        tolerance: &Tolerance,
        before_inverse: &dyn Fn(),
    ) -> Outcome {
        let Self { body, positions, internal, free, link, .. } = self;
        let inverse = |f: &[f64], u: &mut [f64]| {
            before_inverse();
            link.apply(f, u);
        };
        let mut problem = Problem { body, forces: corotation, external, free, inverse: &inverse };
        equilibrium.solve(&mut problem, positions, internal, tolerance)
    }

    /// Moves held vertices to `target` and drags the free ones along as in the warped linear body:
    /// the first iterate of a step.
    pub fn drag(
        &mut self,
        corotation: &dyn InternalForces,
        target: impl Fn(usize) -> Vector3<f64>,
    ) {
        corotation.internal_forces(&mut self.body, &self.positions, &mut self.internal);
        let rotations = self.body.vertex_rotations().to_vec();
        let mut moves = vec![Vector3::zeros(); self.rest.len()];
        for v in (0..self.rest.len()).filter(|&v| !self.free[v]) {
            moves[v] = rotations[v].transpose() * (target(v) - self.positions[v]);
        }
        // −K_fc u_c, the load that the moved vertices put on the others.
        let m = self.element.unknowns();
        let mut load = vec![0.0; m * self.rest.len()];
        for element in self.body.elements() {
            let u = element.vertices.map(|v| moves[v]);
            if u.iter().all(|u| *u == Vector3::zeros()) {
                continue;
            }
            let k = self.element.stiffness(&element.geometry, &element.elasticity);
            for (row, column) in (0..4 * m).flat_map(|i| (0..4 * m).map(move |j| (i, j))) {
                let v = element.vertices[row / m];
                let moved = column % m < 3 && (row % m == 3 || self.free[v]);
                if moved {
                    load[m * v + row % m] -= k[(row, column)] * u[column / m][column % m];
                }
            }
        }
        let mut drag = vec![0.0; load.len()];
        self.link.apply(&load, &mut drag);
        for v in 0..self.rest.len() {
            if self.free[v] {
                self.positions[v] +=
                    rotations[v] * Vector3::from_column_slice(&drag[m * v..m * v + 3]);
            } else {
                self.positions[v] = target(v);
            }
            if m > 3 {
                self.body.set_pressure(v, self.body.pressure(v) + drag[m * v + 3]);
            }
        }
    }

    /// The slot of a vertex in the inverse; none if it is held and has no pressure.
    pub fn slot(&self, vertex: usize) -> Option<usize> {
        Some(self.link.slots[vertex]).filter(|&slot| slot != NO_SLOT)
    }
}

impl Link {
    /// u = C f by vertex number; NaN where f is not finite.
    fn apply(&self, f: &[f64], u: &mut [f64]) {
        let m = self.block;
        let mut load = vec![0.0; m * self.vertices.len()];
        for (slot, &v) in self.vertices.iter().enumerate() {
            load[m * slot..m * slot + m].copy_from_slice(&f[m * v..m * v + m]);
        }
        let mut solution = vec![0.0; load.len()];
        if self.inverse.solve(&load, &mut solution).is_err() {
            solution.fill(f64::NAN);
        }
        u.fill(0.0);
        for (slot, &v) in self.vertices.iter().enumerate() {
            u[m * v..m * v + m].copy_from_slice(&solution[m * slot..m * slot + m]);
        }
    }
}

/// Displacements of held vertices that have slots are held by the unit stiffness.
fn stiffness(
    solid: &Solid,
    body: &Body,
    element: &dyn ElementFormulation,
    free: &[bool],
    slots: &[usize],
) -> Result<SparseStiffness, BenchError> {
    let m = element.unknowns();
    let vertices: Vec<usize> = (0..free.len()).filter(|&v| slots[v] != NO_SLOT).collect();
    let mut k = SparseStiffness::quasi_definite(vertices.len(), m, element.negative())?;
    k.set_order_keys(&order_keys(solid, &vertices))?;
    for tet in body.elements() {
        let kept: Vec<usize> = (0..4).filter(|&i| slots[tet.vertices[i]] != NO_SLOT).collect();
        let mut ke = element.stiffness(&tet.geometry, &tet.elasticity);
        clamp(&mut ke, &tet.vertices.map(|v| !free[v]));
        let rows = m * kept.len();
        let dense = Mat::from_fn(rows, rows, |i, j| {
            let at = |i: usize| m * kept[i / m] + i % m;
            0.5 * (ke[(at(i), at(j))] + ke[(at(j), at(i))])
        });
        let kept: Vec<usize> = kept.iter().map(|&i| slots[tet.vertices[i]]).collect();
        k.add(&kept, dense.as_ref())?;
    }
    let anchor = Mat::from_fn(m, m, |i, j| if i == j && i < 3 { 1.0 } else { 0.0 });
    for v in vertices.into_iter().filter(|&v| !free[v]) {
        k.add(&[slots[v]], anchor.as_ref())?;
    }
    Ok(k)
}

/// Where the vertices lie on a grid of 2²⁰ points a side over the body's box.
fn order_keys(solid: &Solid, vertices: &[usize]) -> Vec<u64> {
    let low = solid.points.iter().copied().reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let high = solid.points.iter().copied().reduce(|a, b| a.sup(&b)).unwrap_or_default();
    let scale = f64::from(1u32 << 20) / (high - low).max().max(f64::MIN_POSITIVE);
    let key = |&v: &usize| {
        let at = (solid.points[v] - low) * scale;
        Lattice::key([at.x as i32, at.y as i32, at.z as i32])
    };
    vertices.iter().map(key).collect()
}
