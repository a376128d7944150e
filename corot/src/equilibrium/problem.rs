//! The equilibrium problem and what a solver reports.

use std::borrow::Cow;
use std::time::Instant;

use nalgebra::{DVector, Matrix3, Vector3};

use super::following::Following;
use super::inverse::Inverse;
use crate::body::Body;
use crate::contact::Pushes;
use crate::field::Field;
use crate::forces::InternalForces;
use crate::grip::{Constraints, Turned};
use crate::time::{Inertia, forces_with_inertia};

/// Find x with f_int(x) = f_ext on the free vertices, up to the forces of constraints; in a
/// [mixed](Body::mixed) body x and q with f_int(x, q) = f_ext there and P q = G u on all vertices, held ones too.
///
/// Solvers mix residuals and steps as plain vectors of [`rows`](Self::rows) entries, vertex-major,
/// and touch positions through the methods here alone: an element with further unknowns per vertex
/// changes this type, no solver. The matrix of a mixed body is indefinite: there is no energy to go
/// down in, and solvers that [need one](crate::Equilibrium::needs_definite) leave it as it is.
pub struct Problem<'a> {
    /// Elements and rotations, renewed with every force evaluation.
    pub body: &'a mut Body,
    /// How forces follow from positions.
    pub forces: &'a dyn InternalForces,
    /// What the step's inertia adds to them; `None` for a static problem.
    pub inertia: Option<&'a Inertia>,
    /// Loads by vertex number, N.
    pub external: &'a Field,
    /// Which vertices may move; the others stay where `positions` has them.
    pub free: &'a [bool],
    /// What tools hold of it besides: G x = g, with multipliers μ as further unknowns.
    pub constraints: Option<&'a Constraints>,
    /// Obstacles that push with forces which follow the positions; none but in solves that a contact asks for.
    pub pushes: Option<&'a Pushes<'a>>,
    /// Loads that follow the positions, besides `external`.
    pub following: &'a [Following],
    /// y = C f: the inverse stiffness of the unrotated body with all but the free vertices
    /// fixed, both by vertex number (3 entries each), zero on the others. m/N.
    ///
    /// For a mixed body the inverse of [K' Gᵀ; G −P], 4 entries each (N and N m, m and 1); q of
    /// vertices that are not free is there too.
    pub inverse: &'a dyn Inverse,
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Relative residual τ: ‖f_ext − f_int‖ over the free vertices must not exceed
    /// τ · max(‖f_ext‖, √Σ‖f_e‖²), nor need it fall below rounding, ε ‖K‖‖x‖.
    pub residual: f64,
    /// Iterations at most, of each method.
    pub max_iterations: usize,
    /// When to stop wherever it is. What a solve ends in then depends on the machine.
    pub deadline: Option<Instant>,
}

impl Tolerance {
    /// Without a deadline.
    pub const fn new(residual: f64, max_iterations: usize) -> Self {
        Self { residual, max_iterations, deadline: None }
    }

    /// Whether its deadline is over.
    pub fn is_late(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

/// How a solve ended. Positions and rotations are those of the smallest residual seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Applications of the inverse (of a tangent's factor for `newton`), by all methods together.
    pub iterations: usize,
    /// Evaluations of the internal forces, by all methods together.
    pub evaluations: usize,
    /// The relative residual where it began.
    pub first: f64,
    /// The relative residual reached.
    pub residual: f64,
    /// Whether the tolerance was reached.
    pub converged: bool,
    /// Scene name of the method that ran last: of the one that converged, if any did.
    pub method: &'static str,
    /// Methods that had given up before it.
    pub fallbacks: usize,
}

/// Where a body stands: positions, and pressures if it has any.
#[derive(Clone, Debug, PartialEq)]
pub struct Iterate {
    positions: Vec<Vector3<f64>>,
    pressures: Vec<f64>,
}

impl Problem<'_> {
    /// The same under other external forces, N by vertex number.
    pub(crate) fn with_loads<'a>(&'a mut self, external: &'a Field) -> Problem<'a> {
        Problem {
            body: &mut *self.body,
            forces: self.forces,
            inertia: self.inertia,
            external,
            free: self.free,
            constraints: self.constraints,
            pushes: self.pushes,
            following: self.following,
            inverse: self.inverse,
        }
    }

    /// The same with obstacles that push.
    pub(crate) fn with_pushes<'a>(&'a mut self, pushes: &'a Pushes<'a>) -> Problem<'a> {
        let external = self.external;
        Problem { pushes: Some(pushes), ..self.with_loads(external) }
    }

    /// The same of another body of as many elements.
    pub(super) fn with_body<'a>(&'a self, body: &'a mut Body) -> Problem<'a> {
        Problem {
            body,
            forces: self.forces,
            inertia: self.inertia,
            external: self.external,
            free: self.free,
            constraints: self.constraints,
            pushes: self.pushes,
            following: self.following,
            inverse: self.inverse,
        }
    }

    /// 3, or 4 in a [mixed](Body::mixed) body.
    pub fn unknowns_per_vertex(&self) -> usize {
        self.body.unknowns_per_vertex()
    }

    /// Entries of a residual or a step: unknowns per vertex times vertex numbers.
    pub fn rows(&self) -> usize {
        self.unknowns_per_vertex() * self.free.len()
    }

    /// Evaluates internal forces and writes f_ext − f_int of the free vertices to `residual`
    /// (0 on the others). Returns its relative size,
    /// ‖f_ext − f_int‖ / max(‖f_ext‖, √Σ‖f_e‖², ε ‖K‖‖x‖ / τ): the last term lets a body that has
    /// come back to rest, where all forces are rounding, count as solved.
    ///
    /// In a [mixed](Body::mixed) body the fourth entry of every vertex, free or not, is
    /// (P q − G u)/h, with 1/h the mean over the elements around of one over the least height: a
    /// volume that is off by θ weighs as the force of a strain of that size, V μ θ/h, N. It belongs
    /// to the norm as the forces do.
    pub fn evaluate(
        &mut self,
        positions: &Field,
        internal: &mut Field,
        residual: &mut [f64],
        tolerance: &Tolerance,
    ) -> f64 {
        let elements =
            forces_with_inertia(self.forces, self.inertia, self.body, positions, internal);
        let m = self.unknowns_per_vertex();
        let mut external = Cow::Borrowed(self.external);
        if let Some(pushes) = self.pushes {
            pushes.add_forces(positions, external.to_mut());
        }
        for following in self.following {
            following.add_forces(positions, external.to_mut());
        }
        for v in 0..positions.len() {
            let r = if self.free[v] { external[v] - internal[v] } else { Vector3::zeros() };
            residual[m * v..m * v + 3].copy_from_slice(r.as_slice());
            if m > 3 {
                let (row, weight) = self.body.pressure_row(v);
                residual[m * v + 3] = weight * row;
            }
        }
        if let Some(constraints) = self.constraints {
            constraints.turned(self.body).balance(residual, m, self.free);
        }
        let mut squares = 0.0;
        for row in residual.chunks_exact(m) {
            squares += Vector3::from_column_slice(&row[..3]).norm_squared();
            row[3..].iter().for_each(|pressure| squares += pressure.powi(2));
        }
        let norm = |a: &Field| a.iter().map(Vector3::norm_squared).sum::<f64>().sqrt();
        let inertial = self.inertia.map_or(0.0, Inertia::stiffness_scale);
        let held = self.body.grip_scale();
        let stiffness = self.forces.stiffness_scale(self.body) + inertial + held;
        let rounding = f64::EPSILON * stiffness * norm(positions);
        let scale = norm(&external).max(elements).max(rounding / tolerance.residual);
        match squares.sqrt() {
            0.0 => 0.0,
            // An overflow is no small residual.
            _ if !scale.is_finite() => f64::NAN,
            size => size / scale,
        }
    }

    /// step = T C Tᵀ residual with T the vertices' rotations of the last evaluation: the warped
    /// inverse of Oishi et al., eq. (2), here the preconditioner.
    ///
    /// T turns displacements alone; the fourth entry of a step is h δq, m, the dual of
    /// [`evaluate`](Self::evaluate)'s. All entries of a step then have one unit, whose squares
    /// mixing may add up.
    ///
    /// With constraints G x = g the step is that of the constrained body, for which G step = 0.
    pub fn precondition(&self, residual: &[f64], scratch: &mut [f64], step: &mut [f64]) {
        let m = self.unknowns_per_vertex();
        let turned = self.constraints.map(|constraints| constraints.turned(self.body));
        scratch.copy_from_slice(residual);
        if let Some(turned) = &turned {
            turned.balance(scratch, m, self.free);
        }
        self.body.turn_back(scratch);
        self.inverse.apply(scratch, step);
        self.body.turn(step);
        if let Some(turned) = turned {
            turned.correct(step, m, None);
        }
    }

    /// step = T C Tᵀ (residual + e), where e acts on `vertices` and `reply` chooses it (N, one each) by
    /// the step there without it (m). Vertices that are not free get nothing of it.
    ///
    /// Cost: two applications of the inverse, or one and a part where it [can
    /// reply](Inverse::apply_and_reply) and there are no constraints.
    pub(crate) fn precondition_and_reply(
        &self,
        residual: &[f64],
        vertices: &[usize],
        reply: impl FnOnce(&[Vector3<f64>]) -> Vec<Vector3<f64>>,
        step: &mut [f64],
    ) {
        let m = self.unknowns_per_vertex();
        let mut scratch = vec![0.0; residual.len()];
        let entry = |y: &[f64], v: usize| Vector3::from_column_slice(&y[m * v..m * v + 3]);
        if self.constraints.is_some() {
            self.precondition(residual, &mut scratch, step);
            let there: Vec<_> = vertices.iter().map(|&v| entry(step, v)).collect();
            let (mut load, mut more) = (vec![0.0; step.len()], vec![0.0; step.len()]);
            for (&v, force) in vertices.iter().zip(reply(&there)) {
                load[m * v..m * v + 3].copy_from_slice(force.as_slice());
            }
            self.precondition(&load, &mut scratch, &mut more);
            step.iter_mut().zip(&more).for_each(|(step, more)| *step += more);
            return;
        }
        scratch.copy_from_slice(residual);
        self.body.turn_back(&mut scratch);
        let rows: Vec<usize> =
            vertices.iter().flat_map(|v| (0..3).map(move |a| m * v + a)).collect();
        let turns = self.body.vertex_rotations();
        let turn = |v: usize| turns.get(v).copied().unwrap_or_else(Matrix3::identity);
        let mut reply = Some(reply);
        let mut reply = |local: &[f64]| {
            let at = vertices.iter().zip(local.as_chunks::<3>().0);
            let there: Vec<_> = at.map(|(&v, d)| turn(v) * Vector3::from(*d)).collect();
            let forces = reply.take().map_or_else(Vec::new, |reply| reply(&there));
            let local = vertices.iter().zip(forces).map(|(&v, force)| turn(v).transpose() * force);
            local.flat_map(<[f64; 3]>::from).collect()
        };
        self.inverse.apply_and_reply(&scratch, &rows, &mut reply, step);
        self.body.turn(step);
    }

    /// Moves the body along with what constraints lead, as in the linear body with its rotations of
    /// the last evaluation, so that G x = g. Where that takes a vertex farther than the body is long, as it may
    /// where rotations of neighbours differ by half a turn, what is held moves alone.
    pub fn meet_constraints(&mut self, positions: &mut [Vector3<f64>]) {
        let Some(constraints) = self.constraints else { return };
        let m = self.unknowns_per_vertex();
        let lack = constraints.lack(positions);
        let step = |held: Turned<'_>| {
            let mut step = vec![0.0; self.rows()];
            held.correct(&mut step, m, Some(lack.clone()));
            step
        };
        let length = |d: &[f64]| Vector3::from_column_slice(&d[..3]).norm();
        let mut along = step(constraints.turned(self.body));
        let far = diagonal(positions) + lack.amax();
        if !along.chunks_exact(m).all(|d| length(d) <= far) {
            let columns = (0..constraints.len()).map(|k| self.force_of(constraints.row(k)));
            along = step(constraints.answered_by(columns.collect(), m));
        }
        self.advance(positions, &along, 1.0);
    }

    /// A row of constraints on the free vertices, as a vector of the problem's rows.
    pub(super) fn force_of(&self, row: &[(usize, Vector3<f64>)]) -> Vec<f64> {
        let m = self.unknowns_per_vertex();
        let mut force = vec![0.0; self.rows()];
        for (v, g) in row.iter().filter(|(v, _)| self.free[*v]) {
            (0..3).for_each(|axis| force[m * v + axis] += g[axis]);
        }
        force
    }

    /// The move (m) and the change of q (1) by vertex number that follow when `forces` (N, by vertex
    /// number) come to act and the targets of constraints change by `lead`, as the linear body with its
    /// rotations of the last evaluation has it.
    pub fn answer(
        &self,
        forces: &Field,
        lead: Option<&DVector<f64>>,
    ) -> (Vec<Vector3<f64>>, Vec<f64>) {
        let m = self.unknowns_per_vertex();
        let [mut residual, mut scratch, mut step] = [(); 3].map(|_| vec![0.0; self.rows()]);
        for (v, force) in forces.iter().enumerate() {
            residual[m * v..m * v + 3].copy_from_slice(force.as_slice());
        }
        self.precondition(&residual, &mut scratch, &mut step);
        if let (Some(constraints), Some(lead)) = (self.constraints, lead) {
            // G step is zero so far.
            constraints.turned(self.body).correct(&mut step, m, Some(lead.clone()));
        }
        let moves = step.chunks_exact(m).map(|d| Vector3::from_column_slice(&d[..3]));
        let weight = |v: usize| self.body.pressure_row(v).1;
        let pressures = step.chunks_exact(m).enumerate();
        let q = pressures.flat_map(|(v, d)| d.get(3).map(|pressure| weight(v) * pressure));
        (moves.collect(), q.collect())
    }

    /// x ← x + `length` · `step`, and the pressures of a [mixed](Body::mixed) body with them.
    pub fn advance(&mut self, positions: &mut Field, step: &[f64], length: f64) {
        let m = self.unknowns_per_vertex();
        for (v, (x, d)) in positions.iter_mut().zip(step.chunks_exact(m)).enumerate() {
            *x += length * Vector3::from_column_slice(&d[..3]);
            if m > 3 {
                let (_, weight) = self.body.pressure_row(v);
                let q = self.body.pressure(v) + length * weight * d[3];
                self.body.set_pressure(v, q);
            }
        }
    }

    /// Where the body stands, to come back to.
    pub fn iterate(&self, positions: &Field) -> Iterate {
        Iterate { positions: positions.to_vec(), pressures: self.body.pressures() }
    }

    /// Moves the body back to where it stood.
    pub fn return_to(&mut self, iterate: &Iterate, positions: &mut Field) {
        positions.copy_from_slice(&iterate.positions);
        self.body.set_pressures(&iterate.pressures);
    }
}

/// The diagonal of the box around `positions`, m.
fn diagonal(positions: &[Vector3<f64>]) -> f64 {
    let all = || positions.iter();
    let least = all().fold(Vector3::repeat(f64::INFINITY), |a, b| a.inf(b));
    let most = all().fold(Vector3::repeat(f64::NEG_INFINITY), |a, b| a.sup(b));
    if positions.is_empty() { 0.0 } else { (most - least).norm() }
}
