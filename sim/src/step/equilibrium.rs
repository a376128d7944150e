//! One step's equilibrium: targets, predictor, solve, and halving where it does not converge.

use std::cell::RefCell;
use std::time::Instant;

use nalgebra::Vector3;
use yawara_corot::{Problem, Tolerance};
use yawara_mesh::VertexId;

use super::contact::{Probing, Surroundings};
use super::simulation::Simulation;
use crate::body::{BodyState, Hold};
use crate::error::SimError;
use crate::inverse::{Constrained, InverseLink};
use crate::report::{StageTimes, milliseconds};
use crate::tools::Tool;

/// A part of a step, from one time to another, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub from: f64,
    pub to: f64,
}

/// How the parts of a step went together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepOutcome {
    pub iterations: usize,
    pub substeps: usize,
    pub fallbacks: usize,
    pub residual: f64,
    pub converged: bool,
}

impl Default for StepOutcome {
    /// Nothing done yet, nothing gone wrong.
    fn default() -> Self {
        Self { iterations: 0, substeps: 0, fallbacks: 0, residual: 0.0, converged: true }
    }
}

impl StepOutcome {
    /// Adds the work of one attempt.
    fn take(&mut self, attempt: &yawara_corot::Outcome) {
        self.iterations += attempt.iterations;
        self.fallbacks += attempt.fallbacks;
    }
}

/// The tools' side of a step: who is held, and the inverse with them fixed.
struct Held<'a> {
    /// Vertex and tool numbers.
    vertices: Vec<(usize, usize)>,
    constrained: Constrained<'a>,
    free: Vec<bool>,
}

/// A first iterate.
struct Moved {
    positions: Vec<Vector3<f64>>,
    pressures: Vec<f64>,
}

/// Solves of one attempt at most while loads follow the body.
const SETTLINGS: usize = 40;

/// Whether loads that follow the body have come to rest with it.
struct Settling<'a> {
    tolerance: &'a Tolerance,
    total: Option<yawara_corot::Outcome>,
    rounds: usize,
}

impl<'a> Settling<'a> {
    fn new(tolerance: &'a Tolerance) -> Self {
        Self { tolerance, total: None, rounds: 0 }
    }

    /// Adds a solve under the loads `old`, which are `new` in its solution. Returns the sum of all
    /// when another solve would change nothing, or can't help.
    fn take(
        &mut self,
        solve: yawara_corot::Outcome,
        old: &[Vector3<f64>],
        new: &[Vector3<f64>],
    ) -> Option<yawara_corot::Outcome> {
        let (iterations, evaluations) =
            self.total.map_or((0, 0), |total| (total.iterations, total.evaluations));
        self.rounds += 1;
        let mut sum = yawara_corot::Outcome {
            iterations: iterations + solve.iterations,
            evaluations: evaluations + solve.evaluations,
            ..solve
        };
        self.total = Some(sum);
        let change: f64 = old.iter().zip(new).map(|(a, b)| (a - b).norm_squared()).sum();
        let size: f64 = new.iter().map(Vector3::norm_squared).sum();
        if change.sqrt() <= self.tolerance.residual * size.sqrt() || !solve.converged {
            return Some(sum);
        }
        sum.converged = false;
        (self.rounds == SETTLINGS).then_some(sum)
    }
}

impl<'a> Held<'a> {
    fn new(state: &BodyState, inverse: &'a InverseLink) -> Result<Self, SimError> {
        let mut free = vec![false; state.positions.len()];
        let mut vertices = Vec::new();
        for v in state.vertices() {
            match state.holds[v.index()] {
                Hold::Free => free[v.index()] = true,
                Hold::Fixed => {}
                Hold::Grabbed(tool) => vertices.push((v.index(), tool)),
            }
        }
        let numbers: Vec<usize> = vertices.iter().map(|&(v, _)| v).collect();
        Ok(Held { constrained: inverse.constrained(&numbers)?, vertices, free })
    }

    /// Positions, and pressures, with the held vertices at their targets and the others dragged
    /// along as in the warped linear body: the first iterate.
    fn drag(&self, state: &BodyState, tools: &[Box<dyn Tool>], t: f64) -> Result<Moved, SimError> {
        let mut positions = state.positions.clone();
        let mut pressures = state.body.pressures();
        if self.vertices.is_empty() {
            return Ok(Moved { positions, pressures });
        }
        let rotations = state.body.vertex_rotations();
        let targets: Vec<Vector3<f64>> =
            self.vertices.iter().map(|&(v, tool)| tools[tool].target(&state.rest[v], t)).collect();
        let moves: Vec<Vector3<f64>> = self
            .vertices
            .iter()
            .zip(&targets)
            .map(|(&(v, _), target)| rotations[v].transpose() * (target - positions[v]))
            .collect();
        let m = state.body.unknowns_per_vertex();
        let mut drag = vec![0.0; m * positions.len()];
        self.constrained.drag(&moves, &mut drag)?;
        for (v, d) in drag.chunks_exact(m).enumerate() {
            positions[v] += rotations[v] * Vector3::from_column_slice(&d[..3]);
        }
        // Shorter by those that have come in without a pressure since; none without pressures.
        for (q, d) in pressures.iter_mut().zip(drag.chunks_exact(m)) {
            *q += d[m - 1];
        }
        for (&(v, _), target) in self.vertices.iter().zip(&targets) {
            positions[v] = *target;
        }
        Ok(Moved { positions, pressures })
    }
}

impl Simulation {
    /// Brings the body from the last equilibrium to the end of `step`, in halves where the whole
    /// does not converge. Where even the smallest part does not, the body stays at the last
    /// equilibrium on the way, and the next step starts from there.
    pub(crate) fn advance(
        &mut self,
        step: Span,
        times: &mut StageTimes,
    ) -> Result<StepOutcome, SimError> {
        let mut total = StepOutcome::default();
        self.set_off(step);
        self.begin_trend();
        let smallest = (step.to - step.from) / f64::from(1u32 << self.scene.solver.max_halvings);
        let mut waiting = vec![step];
        while let Some(span) = waiting.pop() {
            let before = self.state.standing();
            let mut outcome = self.attempt(step, span, times)?;
            total.take(&outcome);
            if !outcome.converged && !self.fading.is_empty() && span.to == step.to {
                // Under a dead load the pulled shape may be unstable where the tool's hold made it
                // stable: there is no path to follow, but the released shape may be near rest.
                self.state.rest();
                outcome = self.attempt(step, span, times)?;
                total.take(&outcome);
            }
            if outcome.converged {
                total.substeps += 1;
                total.residual = total.residual.max(outcome.residual);
                self.reached_s = span.to;
                continue;
            }
            self.state.return_to(before);
            if span.to - span.from > 1.5 * smallest {
                self.statistics.halvings += 1;
                let middle = 0.5 * (span.from + span.to);
                waiting.push(Span { from: middle, to: span.to });
                waiting.push(Span { from: span.from, to: middle });
                continue;
            }
            tracing::warn!(
                "no equilibrium at {:.4} s (relative residual {:.1e}): the body stays as it was \
                 at {:.4} s",
                span.to,
                outcome.residual,
                self.reached_s
            );
            total.residual = outcome.residual;
            total.converged = false;
            self.evaluate_forces();
            break;
        }
        let left = (step.to - self.reached_s) / (step.to - step.from);
        for (_, force) in &mut self.fading {
            *force *= left;
        }
        if total.converged {
            self.fading.clear();
        }
        self.arrive();
        self.end_trend(&total);
        Ok(total)
    }

    /// Moves tools and loads to the end of `span` and solves.
    fn attempt(
        &mut self,
        step: Span,
        span: Span,
        times: &mut StageTimes,
    ) -> Result<yawara_corot::Outcome, SimError> {
        let begin = Instant::now();
        let mut own = self.loads(step, span.to);
        self.ease_in(step, span.to, &mut own);
        // Elements and vertices may have come in since the last solve: renew their rotations.
        self.evaluate_forces();
        let probing = self.probing(span.to);
        if span == step {
            self.coast();
        }
        let share = if span == step { self.follow_trend(&probing) } else { 0.0 };
        let held = Held::new(&self.state, &self.inverse)?;
        let numbers: Vec<usize> = held.vertices.iter().map(|&(v, _)| v).collect();
        let moved = held.drag(&self.state, &self.tools, span.to)?;
        times.tool_ms += milliseconds(begin);

        let begin = Instant::now();
        let timing = RefCell::new((Vec::new(), None));
        let inverse = |f: &[f64], y: &mut [f64]| {
            let begin = Instant::now();
            let result = held.constrained.apply(f, y);
            let mut timing = timing.borrow_mut();
            timing.0.push(milliseconds(begin));
            if let Err(error) = result {
                y.fill(f64::NAN);
                timing.1 = Some(error);
            }
        };
        self.state.positions = moved.positions;
        self.state.body.set_pressures(&moved.pressures);
        let tolerance = Tolerance {
            residual: self.scene.solver.residual,
            max_iterations: self.scene.solver.max_iterations,
        };
        let around = Surroundings {
            tools: &self.tools,
            probing: &probing,
            inverse: &self.inverse,
            held: &numbers,
            share,
        };
        let mut pressed = self.pressed(span.to);
        let mut settling = Settling::new(&tolerance);
        let moving = self.motion.as_ref().and_then(|motion| motion.forces(&*self.corotation));
        let outcome = loop {
            let external: Vec<_> = own.iter().zip(&pressed).map(|(a, b)| a + b).collect();
            let mut problem = Problem {
                body: &mut self.state.body,
                forces: moving.as_ref().map_or(&*self.corotation, |moving| moving),
                external: &external,
                free: &held.free,
                inverse: &inverse,
            };
            let outcome = self.contact.solve(
                &mut problem,
                self.equilibrium.as_mut(),
                &mut self.state.positions,
                &mut self.internal,
                &tolerance,
                &around,
            )?;
            let renewed = self.pressed(span.to);
            if let Some(end) = settling.take(outcome, &pressed, &renewed) {
                break end;
            }
            pressed = renewed;
        };
        times.solve_ms += milliseconds(begin);
        if outcome.converged {
            self.contact.add_loads(&mut pressed);
            self.tool_loads = pressed;
        }
        self.statistics.count(&outcome);
        let (solve_ms, error) = timing.into_inner();
        self.statistics.solve_ms.extend(solve_ms);
        match error {
            // A non-finite residual is a failed attempt, which a shorter step may cure.
            Some(SimError::Inverse(yawara_inverse_update::InverseError::NotFinite { .. }))
            | None => Ok(outcome),
            Some(error) => Err(error),
        }
    }

    /// The probes that act at time `t`.
    fn probing(&self, t: f64) -> Vec<Probing> {
        let probes = self.tools.iter().enumerate().filter_map(|(tool, one)| {
            let sphere = one.obstacle(t)?;
            let moved = sphere.centre - one.reference(self.reached_s);
            Some(Probing { tool, sphere, moved })
        });
        probes.collect()
    }

    /// Loads of tools on vertices at time `t`, where the body is now, by vertex number, N.
    fn pressed(&self, t: f64) -> Vec<Vector3<f64>> {
        let mut loads = vec![Vector3::zeros(); self.state.positions.len()];
        for tool in self.tools.iter().filter(|tool| tool.loads() && tool.acts_at(t)) {
            tool.add_loads(&self.state, t, &mut loads);
        }
        loads
    }

    /// Renews rotations and internal forces at the current positions.
    pub(crate) fn evaluate_forces(&mut self) {
        self.internal.resize(self.state.positions.len(), Vector3::zeros());
        let moving = self.motion.as_ref().and_then(|motion| motion.forces(&*self.corotation));
        let corotation = moving.as_ref().map_or(&*self.corotation, |moving| moving);
        corotation.internal_forces(&mut self.state.body, &self.state.positions, &mut self.internal);
    }

    /// Loads at time `t` within `step`: weight, and what tools have just let go of.
    fn loads(&self, step: Span, t: f64) -> Vec<Vector3<f64>> {
        let mut loads = self.weights(t);
        let left = (step.to - t) / (step.to - step.from);
        for (v, force) in &self.fading {
            loads[v.index()] += left * force;
        }
        loads
    }

    /// Weight of each vertex: a quarter of each element's mass; it grows over the first step.
    pub(crate) fn weights(&self, t: f64) -> Vec<Vector3<f64>> {
        let mut weights = vec![Vector3::zeros(); self.state.positions.len()];
        let gravity = self.gravity * (t / self.scene.time.step_s).min(1.0);
        if gravity == Vector3::zeros() {
            return weights;
        }
        for element in self.state.body.elements() {
            let density = self.state.cell(element.tet).density_kg_m3;
            let mass = element.geometry.volume * density;
            for v in element.vertices {
                weights[v] += 0.25 * mass * gravity;
            }
        }
        weights
    }

    /// Internal minus external force on a vertex at the last solve, at time `t`, N.
    pub(crate) fn reaction(&self, vertices: &[VertexId], t: f64) -> Vec<Vector3<f64>> {
        let weights = self.weights(t);
        let load = |v: usize| self.tool_loads.get(v).copied().unwrap_or_default();
        let force = |v: &VertexId| {
            let v = v.index();
            self.internal[v] - weights[v] - load(v)
        };
        vertices.iter().map(force).collect()
    }
}
