//! A held [`Solid`] with the inverse of its stiffness: what an equilibrium solver works on.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara::inverse::{Assembly, SlotMap};
use yawara_corot::{
    Body, ConstitutiveLaw, Equilibrium, InternalForces, Outcome, Problem, Tolerance,
};
use yawara_embed::{ElementFormulation, P1, P1P1};
use yawara_inverse_update::InverseMaintainer;
use yawara_mesh::{Lattice, VertexId};

use crate::bodies::solid::Solid;
use crate::error::Result;
use crate::solvers::inverse_at_rest;

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
    slots: SlotMap,
    inverse: Box<dyn InverseMaintainer>,
    /// Unknowns per vertex.
    block: usize,
}

impl Statics {
    /// Factors the stiffness of `solid` with the vertices held for which `held` says so.
    /// # Errors
    /// `BenchError::Inverse` if it is not held well enough.
    pub fn new(solid: &Solid, held: impl Fn(&Vector3<f64>) -> bool) -> Result<Self> {
        Self::with_element(solid, held, None)
    }

    /// The same, with pressures beside displacements if `mixed` is there.
    pub(crate) fn with_element(
        solid: &Solid,
        held: impl Fn(&Vector3<f64>) -> bool,
        mixed: Option<P1P1>,
    ) -> Result<Self> {
        match mixed {
            Some(element) => {
                Self::of(solid, held, solid.fill(Body::mixed(element)), Box::new(element))
            }
            None => Self::of(solid, held, solid.body(), Box::new(P1)),
        }
    }

    /// With pressures, under a law that knows of each element what it is `made_of`.
    pub(crate) fn under(
        solid: &Solid,
        held: impl Fn(&Vector3<f64>) -> bool,
        element: P1P1,
        law: Arc<dyn ConstitutiveLaw>,
        made_of: &[f64],
    ) -> Result<Self> {
        let body = solid.fill_made_of(Body::mixed(element).with_law(law), made_of);
        Self::of(solid, held, body, Box::new(element))
    }

    fn of(
        solid: &Solid,
        held: impl Fn(&Vector3<f64>) -> bool,
        body: Body,
        element: Box<dyn ElementFormulation>,
    ) -> Result<Self> {
        let free: Vec<bool> = solid.points.iter().map(|x| !held(x)).collect();
        let order_key = order_keys(solid);
        let is_fixed = |v: VertexId| !free[v.index()];
        let assembly = Assembly::new(element.as_ref(), &is_fixed, &order_key);
        let slots = assembly.slots((0..free.len()).map(|v| VertexId(v as u32)));
        let inverse = inverse_at_rest(assembly.assemble(body.elements(), &slots)?)?;
        let link = Link { slots, inverse, block: element.unknowns() };
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
        let mut problem = Problem {
            body,
            forces: corotation,
            inertia: None,
            external,
            free,
            constraints: None,
            pushes: None,
            following: &[],
            inverse: &inverse,
        };
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

    /// How far a vertex is from its rest position.
    pub fn displacement(&self, vertex: usize) -> Vector3<f64> {
        self.positions[vertex] - self.rest[vertex]
    }
}

impl Link {
    /// u = C f by vertex number; NaN where f is not finite.
    fn apply(&self, f: &[f64], u: &mut [f64]) {
        let load = self.slots.gather(self.block, f);
        let mut solution = vec![0.0; load.len()];
        if self.inverse.solve(&load, &mut solution).is_err() {
            solution.fill(f64::NAN);
        }
        self.slots.scatter(self.block, &solution, u);
    }
}

/// Where a vertex lies on a grid of 2²⁰ points a side over the body's box.
fn order_keys(solid: &Solid) -> impl Fn(VertexId) -> u64 + '_ {
    let low = solid.points.iter().copied().reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let high = solid.points.iter().copied().reduce(|a, b| a.sup(&b)).unwrap_or_default();
    let scale = f64::from(1u32 << 20) / (high - low).max().max(f64::MIN_POSITIVE);
    move |v| {
        let at = (solid.points[v.index()] - low) * scale;
        Lattice::key([at.x as i32, at.y as i32, at.z as i32])
    }
}
