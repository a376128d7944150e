//! A held [`Solid`] with the inverse of its stiffness: what an equilibrium solver works on.

use faer::Mat;
use nalgebra::Vector3;
use yawara_corot::{Body, Corotation, Equilibrium, Outcome, Problem, Tolerance};
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
}

/// The inverse, and which vertex has which slot in it.
struct Link {
    slots: Vec<usize>,
    vertices: Vec<usize>,
    inverse: Box<dyn InverseMaintainer>,
}

const NO_SLOT: usize = usize::MAX;

impl Statics {
    /// Factors the stiffness of `solid` with the vertices held for which `held` says so.
    ///
    /// # Errors
    /// [`BenchError::Inverse`] if it is not held well enough.
    pub fn new(solid: &Solid, held: impl Fn(&Vector3<f64>) -> bool) -> Result<Self, BenchError> {
        let free: Vec<bool> = solid.points.iter().map(|x| !held(x)).collect();
        let vertices: Vec<usize> = (0..free.len()).filter(|&v| free[v]).collect();
        let mut slots = vec![NO_SLOT; free.len()];
        vertices.iter().enumerate().for_each(|(slot, &v)| slots[v] = slot);
        let body = solid.body();
        let inverse = build("sparse", stiffness(solid, &body, &slots, &vertices)?)?;
        let link = Link { slots, vertices, inverse };
        let positions = solid.points.clone();
        let internal = vec![Vector3::zeros(); free.len()];
        Ok(Self { body, rest: positions.clone(), positions, internal, free, link })
    }

    /// Solves for the free vertices from where they are.
    ///
    /// `before_inverse` is called with every application of the inverse.
    pub fn solve(
        &mut self,
        corotation: &dyn Corotation,
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
        let mut problem = Problem { body, corotation, external, free, inverse: &inverse };
        equilibrium.solve(&mut problem, positions, internal, tolerance)
    }

    /// Moves held vertices to `target` and drags the free ones along as in the warped linear body:
    /// the first iterate of a step.
    pub fn drag(&mut self, corotation: &dyn Corotation, target: impl Fn(usize) -> Vector3<f64>) {
        corotation.internal_forces(&mut self.body, &self.positions, &mut self.internal);
        let rotations = self.body.vertex_rotations().to_vec();
        let mut moves = vec![Vector3::zeros(); self.rest.len()];
        for v in (0..self.rest.len()).filter(|&v| !self.free[v]) {
            moves[v] = rotations[v].transpose() * (target(v) - self.positions[v]);
        }
        // −K_fc u_c, the load that the moved vertices put on the others.
        let mut load = vec![0.0; 3 * self.rest.len()];
        for element in self.body.elements() {
            let u = element.vertices.map(|v| moves[v]);
            if u.iter().all(|u| *u == Vector3::zeros()) {
                continue;
            }
            let k = element.geometry.stiffness(&element.elasticity);
            for (i, &v) in element.vertices.iter().enumerate() {
                for (j, u) in u.iter().enumerate() {
                    let force = k.fixed_view::<3, 3>(3 * i, 3 * j) * u;
                    (0..3).for_each(|axis| load[3 * v + axis] -= force[axis]);
                }
            }
        }
        let mut drag = vec![0.0; load.len()];
        self.link.apply(&load, &mut drag);
        for v in 0..self.rest.len() {
            if self.free[v] {
                self.positions[v] +=
                    rotations[v] * Vector3::from_column_slice(&drag[3 * v..3 * v + 3]);
            } else {
                self.positions[v] = target(v);
            }
        }
    }

    /// The slot of a vertex in the inverse; none if it is held.
    pub fn slot(&self, vertex: usize) -> Option<usize> {
        Some(self.link.slots[vertex]).filter(|&slot| slot != NO_SLOT)
    }
}

impl Link {
    /// u = C f by vertex number; NaN where f is not finite.
    fn apply(&self, f: &[f64], u: &mut [f64]) {
        let mut load = vec![0.0; 3 * self.vertices.len()];
        for (slot, &v) in self.vertices.iter().enumerate() {
            load[3 * slot..3 * slot + 3].copy_from_slice(&f[3 * v..3 * v + 3]);
        }
        let mut solution = vec![0.0; load.len()];
        if self.inverse.solve(&load, &mut solution).is_err() {
            solution.fill(f64::NAN);
        }
        u.fill(0.0);
        for (slot, &v) in self.vertices.iter().enumerate() {
            u[3 * v..3 * v + 3].copy_from_slice(&solution[3 * slot..3 * slot + 3]);
        }
    }
}

fn stiffness(
    solid: &Solid,
    body: &Body,
    slots: &[usize],
    vertices: &[usize],
) -> Result<SparseStiffness, BenchError> {
    let mut k = SparseStiffness::zeros(vertices.len(), 3)?;
    k.set_order_keys(&order_keys(solid, vertices))?;
    for element in body.elements() {
        let kept: Vec<usize> = (0..4).filter(|&i| slots[element.vertices[i]] != NO_SLOT).collect();
        let ke = element.geometry.stiffness(&element.elasticity);
        let rows = 3 * kept.len();
        let dense = Mat::from_fn(rows, rows, |i, j| {
            let at = |i: usize| 3 * kept[i / 3] + i % 3;
            0.5 * (ke[(at(i), at(j))] + ke[(at(j), at(i))])
        });
        let kept: Vec<usize> = kept.iter().map(|&i| slots[element.vertices[i]]).collect();
        k.add(&kept, dense.as_ref())?;
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
