//! One step's equilibrium: targets, first iterate, solve, and halving where it does not converge.

use std::time::Instant;

use nalgebra::{Vector3, Vector6};
use yawara_corot::{
    Equilibrium, InternalForces, Loads, Outcome, Problem, Tolerance, forces_with_inertia,
};
use yawara_inverse_update::InverseError;
use yawara_mesh::VertexId;

use super::checkpoint::{KeptForces, KeptSolver, Numbers};
use super::contact::{ContactState, Probing, Surroundings};
use super::dynamics::Motion;
use super::easing::{Easing, ease_steps};
use super::grips::Grips;
use super::held::Held;
use super::indicator::Dual;
use super::missed;
use super::pace::Pace;
use super::predictor::{Move, Predictor};
use super::refinement::Exchange;
use super::settling::Settling;
use super::span::Span;
use super::tool_loads::ToolLoads;
use crate::body::{BodyState, Hold};
use crate::error::SimError;
use crate::inverse::{Applied, InverseLink};
use crate::report::{Momentum, StepOutcome, milliseconds};
use crate::scene::{Scene, Solver};
use crate::tools::Tool;

/// One in so many of a step's iterations is kept for an attempt from rest where none from the last equilibrium arrives.
const KEPT: usize = 4;

/// What a step moves, and what acts on it.
pub(crate) struct Acting<'a> {
    pub state: &'a mut BodyState,
    pub contact: &'a mut ContactState,
    pub tools: &'a [Box<dyn Tool>],
    pub inverse: &'a InverseLink,
}

/// Brings a body from equilibrium to equilibrium, or through motion with inertia.
pub(crate) struct StepSolver {
    pub(super) forces: Box<dyn InternalForces>,
    equilibrium: Box<dyn Equilibrium>,
    rules: Solver,
    step_s: f64,
    /// Gravity in solver axes, m/s².
    gravity: Vector3<f64>,
    /// None for a quasi-static scene.
    motion: Option<Motion>,
    predictor: Predictor,
    /// Internal forces at the last solve, by vertex number, N.
    internal: Vec<Vector3<f64>>,
    /// Forces of tools on vertices at the last equilibrium, by vertex number, N. Vertices that have
    /// come in since are not in it.
    tool_loads: Vec<Vector3<f64>>,
    /// Forces of tools that have just let go; they fade to zero within the step of the release.
    fading: Vec<(VertexId, Vector3<f64>)>,
    /// What splits and merges have left unbalanced.
    easing: Easing,
    /// What tools hold of the material.
    pub grips: Grips,
    /// Time up to which the body has been followed, s: behind the clock after a failed step.
    reached_s: f64,
    /// When the step under way has to end wherever it is.
    deadline: Option<Instant>,
    pace: Pace,
}

impl StepSolver {
    /// At rest at time 0; `gravity` in solver axes, m/s².
    pub fn new(
        forces: Box<dyn InternalForces>,
        equilibrium: Box<dyn Equilibrium>,
        scene: &Scene,
        gravity: Vector3<f64>,
        motion: Option<Motion>,
    ) -> Self {
        Self {
            forces,
            equilibrium,
            rules: scene.solver.clone(),
            step_s: scene.time.step_s,
            gravity,
            motion,
            predictor: Predictor::default(),
            internal: Vec::new(),
            tool_loads: Vec::new(),
            fading: Vec::new(),
            easing: Easing::new(ease_steps(scene)),
            grips: Grips::default(),
            reached_s: 0.0,
            deadline: None,
            pace: Pace::new(if scene.time.adaptive { scene.solver.max_halvings } else { 0 }),
        }
    }

    /// What the next step starts from besides the body.
    pub fn kept(&self, numbers: &Numbers) -> KeptSolver {
        let moves = self.predictor.last().iter().map(|(tool, by)| (*tool, (*by).into()));
        let fading = self.fading.iter().map(|(v, force)| (v.index(), force));
        KeptSolver {
            moves: moves.collect(),
            steady: self.predictor.steady(),
            tool_loads: numbers.forces(self.tool_loads.iter().enumerate()),
            fading: numbers.forces(fading),
            easing: (self.easing.left(), numbers.forces(self.easing.loads().iter().enumerate())),
            grips: self.grips.kept(numbers),
            reached_s: self.reached_s,
            pace: self.pace.kept(),
        }
    }

    /// Goes on from what was kept, with the rotations and forces of `state`.
    pub fn resume(&mut self, kept: &KeptSolver, state: &mut BodyState) {
        let moves = kept.moves.iter().map(|(tool, by)| (*tool, Vector6::from(*by)));
        self.predictor = Predictor::after(moves.collect(), kept.steady);
        let field = |forces: &KeptForces| {
            let mut field = vec![Vector3::zeros(); state.positions.len()];
            forces.iter().for_each(|(v, force)| field[*v] = Vector3::from(*force));
            field
        };
        self.tool_loads = field(&kept.tool_loads);
        self.easing.resume(kept.easing.0, field(&kept.easing.1));
        let fading = kept.fading.iter().map(|(v, f)| (VertexId(*v as u32), Vector3::from(*f)));
        self.fading = fading.collect();
        self.grips = Grips::resumed(&kept.grips, state);
        self.reached_s = kept.reached_s;
        self.pace.resume(kept.pace);
        self.internal.clear();
        self.evaluate_forces(state);
    }

    /// The mesh, or what it is made of, has changed.
    pub fn jolt(&mut self) {
        self.predictor.jolt();
    }

    /// The length of a step, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Time up to which the body has been followed, s.
    pub fn reached_s(&self) -> f64 {
        self.reached_s
    }

    /// Whether rotations of elements go with positions.
    pub fn turns(&self) -> bool {
        self.forces.turns()
    }

    /// Whether the body has inertia.
    pub fn is_dynamic(&self) -> bool {
        self.motion.is_some()
    }

    /// Whether nothing but tools acts on a body without inertia.
    pub fn is_left_to_tools(&self) -> bool {
        self.motion.is_none() && self.gravity == Vector3::zeros() && self.fading.is_empty()
    }

    /// Whether nothing acts on a body at time `t` that has neither inertia nor a memory: it is at rest then.
    fn is_unloaded(&self, t: f64, acting: &Acting<'_>) -> bool {
        self.motion.is_none()
            && self.gravity == Vector3::zeros()
            && acting.state.body.law().state_len() == 0
            && !acting.tools.iter().any(|tool| tool.acts_at(t))
    }

    /// The dual of a figure of `value`: how the body of the last equilibrium answers when a tool moves by
    /// `lead`, or to `loads`, m and N.
    ///
    /// Vertices that tools hold stay. Cost: an application of the inverse, two under contact.
    /// # Errors
    /// [`SimError::Inverse`] if the inverse fails.
    pub fn answer(
        &self,
        value: f64,
        lead: Option<(usize, Vector3<f64>)>,
        mut loads: Loads,
        acting: &mut Acting<'_>,
    ) -> Result<Dual, SimError> {
        let Acting { state, contact, inverse, .. } = acting;
        let held = Held::new(state, inverse)?;
        let mut forces = loads.vertices().to_vec();
        forces.resize(state.positions.len(), Vector3::zeros());
        let leads = lead.map(|(tool, lead)| {
            self.grips.add_pads(tool, &lead, state, &mut forces);
            self.grips.leads(tool, &lead, state)
        });
        let applied = Applied::new(&held.constrained);
        let constraints = self.grips.constraints();
        let problem = Problem {
            body: &mut state.body,
            forces: &*self.forces,
            inertia: None,
            external: &[],
            free: &held.free,
            constraints,
            pushes: None,
            following: &[],
            inverse: &applied,
        };
        let (mut moves, mut pressures) = problem.answer(&forces, leads.as_ref());
        if contact.is_pressed() {
            let mut pushes = vec![Vector3::zeros(); moves.len()];
            contact.add_changes(&moves, lead, &mut pushes, &mut loads);
            let (more, of_more) = problem.answer(&pushes, None);
            moves.iter_mut().zip(more).for_each(|(a, b)| *a += b);
            pressures.iter_mut().zip(of_more).for_each(|(a, b)| *a += b);
            forces.iter_mut().zip(pushes).for_each(|(a, b)| *a += b);
        }
        if let (_, Some(error)) = applied.end() {
            return Err(error);
        }
        let rows = constraints.map_or_else(Vec::new, |constraints| {
            constraints.forces_under(&state.body, &forces, leads.as_ref())
        });
        self.grips.add_changes(&moves, lead, rows, state, &mut loads);
        Ok(Dual { value, field: moves, pressures, loads })
    }

    /// Mass, momentum and energy of a body with inertia.
    pub fn momentum(&self, state: &BodyState) -> Option<Momentum> {
        Some(self.motion.as_ref()?.momentum(state))
    }

    /// Frees what tools hold that let go before `step` ends; their reactions fade out.
    ///
    /// # Errors
    /// [`SimError::Inverse`] if the inverse refuses to lose the stiffness of a pad.
    pub fn let_go(
        &mut self,
        step: Span,
        state: &mut BodyState,
        inverse: &mut InverseLink,
        tools: &[Box<dyn Tool>],
    ) -> Result<(), SimError> {
        self.grips.let_go(step.to, state, inverse, tools, |force| {
            if self.motion.is_none() {
                self.fading.push(force);
            }
        })?;
        let leaving: Vec<VertexId> = state
            .vertices()
            .filter(|v| match state.holds[v.index()] {
                Hold::Grabbed(tool) => !tools[tool].acts_at(step.to),
                Hold::Free | Hold::Fixed => false,
            })
            .collect();
        if leaving.is_empty() {
            return Ok(());
        }
        // With inertia the body moves on by itself: nothing has to fade.
        if self.motion.is_none() {
            // Vertices may have come in since the last solve.
            self.evaluate_forces(state);
            let reactions = self.reaction(state, &leaving, step.from);
            self.fading.extend(leaving.iter().copied().zip(reactions));
        }
        for v in leaving {
            state.holds[v.index()] = Hold::Free;
        }
        Ok(())
    }

    /// Brings the body from the last equilibrium to the end of `step`, in parts where the whole
    /// does not converge. Where even the shortest does not, or where the iterations for them are used up, a body without
    /// inertia or deadline goes there from rest; where that fails too it stays at the last equilibrium on the way, and the next
    /// step starts from there. At a `deadline` it stays where the least residual was.
    pub fn advance(
        &mut self,
        step: Span,
        acting: &mut Acting<'_>,
        deadline: Option<Instant>,
    ) -> Result<StepOutcome, SimError> {
        self.deadline = deadline;
        let mut total = StepOutcome::default();
        total.report.converged = true;
        // A clock has no time for a way round, and shows where the body is on the way.
        let mut kept = match (&self.motion, deadline) {
            (None, None) => self.rules.step_iterations / KEPT,
            _ => 0,
        };
        self.set_off(step, acting.state);
        self.predictor.begin(acting.state);
        acting.contact.begin();
        while self.reached_s < step.to {
            let span = self.pace.next(self.reached_s, step);
            let before = acting.state.standing();
            if span.to == step.to && self.is_unloaded(step.to, acting) {
                // No way back from a pulled shape, which may be unstable now, leads anywhere else.
                acting.state.rest();
                self.easing.clear();
            }
            let mut outcome = self.attempt(step, span, kept, acting, &mut total)?;
            let is_released = !self.fading.is_empty() && span.to == step.to;
            let may_go_on = |total: &_, kept| self.tolerance(total, kept).max_iterations > 0;
            if !outcome.converged && is_released && may_go_on(&total, kept) {
                // Under a dead load the pulled shape may be unstable where the tool's hold made it
                // stable: there is no path to follow, but the released shape may be near rest.
                acting.state.rest();
                outcome = self.attempt(step, span, kept, acting, &mut total)?;
            }
            let is_late = self.tolerance(&total, kept).is_late();
            if outcome.converged || is_late {
                // Solved parts that the clock cuts off are no solved step.
                let is_whole = span.to == step.to || !is_late;
                total.report.converged = outcome.converged && is_whole;
                total.report.substeps += 1;
                total.report.residual = total.report.residual.max(outcome.residual);
                self.reached_s = span.to;
                if is_late {
                    break;
                }
                self.pace.succeed();
                continue;
            }
            acting.state.put(before);
            let may_go_on = self.tolerance(&total, kept).max_iterations > 0;
            if self.pace.fail(span, step) && may_go_on {
                total.halvings += 1;
                continue;
            }
            if kept > 0 {
                // No way leads on from here, or none that is short enough: another equilibrium may be near rest.
                kept = 0;
                let here = acting.state.standing();
                acting.state.rest();
                self.predictor.turn();
                let whole = Span { from: self.reached_s, ..step };
                let outcome = self.attempt(step, whole, kept, acting, &mut total)?;
                if outcome.converged {
                    total.report.residual = total.report.residual.max(outcome.residual);
                    total.report.substeps += 1;
                    total.from_rest += 1;
                    self.reached_s = step.to;
                    self.pace.begin_anew();
                    break;
                }
                acting.state.put(here);
            }
            tracing::warn!(
                "no equilibrium at {:.4} s (relative residual {:.1e}): the body stays as it was \
                 at {:.4} s",
                span.to,
                outcome.residual,
                self.reached_s
            );
            total.report.residual = outcome.residual;
            total.report.converged = false;
            self.evaluate_forces(acting.state);
            break;
        }
        self.arrive(step, &total, acting);
        Ok(total)
    }

    /// Begins a step: of the law, and of a body with inertia.
    fn set_off(&mut self, step: Span, state: &mut BodyState) {
        state.body.begin_step(self.step_s);
        self.easing.step();
        if self.motion.is_some() {
            self.evaluate_forces(state);
            let loads = self.weights(state, step.to);
            if let Some(motion) = &mut self.motion {
                motion.begin(&*self.forces, state, loads, &mut self.internal);
            }
        }
    }

    /// Ends a step: states of the law, velocities, and what the next step may start from.
    fn arrive(&mut self, step: Span, total: &StepOutcome, acting: &mut Acting<'_>) {
        let StepOutcome { report, from_rest, .. } = total;
        let left = step.left_at(self.reached_s);
        let is_released = !self.fading.is_empty();
        for (_, force) in &mut self.fading {
            *force *= left;
        }
        if report.converged {
            self.fading.clear();
        }
        acting.state.body.commit();
        match &mut self.motion {
            Some(motion) => motion.finish(acting.state),
            None => {
                let is_whole = report.converged && report.substeps == 1 && *from_rest == 0;
                let continues = is_whole && !is_released;
                acting.contact.end(continues);
                let is_smooth = !acting.contact.is_pressed();
                self.predictor.end(continues, is_smooth, acting.state, self.step_s);
            }
        }
    }

    /// Moves tools and loads to the end of `span` and solves, with all iterations of the step that are left but `kept`;
    /// adds the work to `total`.
    fn attempt(
        &mut self,
        step: Span,
        span: Span,
        kept: usize,
        acting: &mut Acting<'_>,
        total: &mut StepOutcome,
    ) -> Result<Outcome, SimError> {
        let Acting { state, contact, tools, inverse } = acting;
        let (tools, inverse) = (*tools, *inverse);
        let begin = Instant::now();
        let own = self.loads(state, step, span.to);
        let held = Held::new(state, inverse)?;
        let constraints = self.grips.lead(span.to, state, inverse, tools, &held.constrained)?;
        let constraints = constraints.as_ref();
        self.internal.resize(state.positions.len(), Vector3::zeros());
        if constraints.is_some() || !held.vertices.is_empty() {
            // What is held takes the rest along as it is turned now, with what has come in since.
            self.evaluate_forces(state);
        }
        let probing = self.probing(tools, span.to);
        let share = match span == step {
            true => self.predict(self.moves(tools, &held, span.to, state), state),
            false => 0.0,
        };
        let moved = held.drag(state, tools, span.to)?;
        total.report.times.tool_ms += milliseconds(begin);

        let begin = Instant::now();
        let applied = Applied::new(&held.constrained);
        state.put(moved);
        let tolerance = self.tolerance(total, kept);
        let around =
            Surroundings { tools, probing: &probing, inverse, held: &held.vertices, share };
        let follows = self.equilibrium.takes_following() && self.forces.tangent().is_some();
        let tool_loads = ToolLoads::new(state, tools, span.to, follows);
        let mut pressed = tool_loads.lagging(state);
        let mut settling = Settling::new(&tolerance, self.iterations_left(total, kept));
        let inertia = self.motion.as_ref().and_then(Motion::inertia);
        let outcome = loop {
            let external: Vec<_> = own.iter().zip(&pressed).map(|(a, b)| a + b).collect();
            let mut problem = Problem {
                body: &mut state.body,
                forces: &*self.forces,
                inertia,
                external: &external,
                free: &held.free,
                constraints,
                pushes: None,
                following: &tool_loads.following,
                inverse: &applied,
            };
            problem.meet_constraints(&mut state.positions);
            let outcome = contact.solve(
                &mut problem,
                self.equilibrium.as_mut(),
                &mut state.positions,
                &mut self.internal,
                &tolerance,
                &around,
            )?;
            let renewed = tool_loads.lagging(state);
            if let Some(end) = settling.take(outcome, &pressed, &renewed) {
                break end;
            }
            pressed = renewed;
        };
        total.report.times.solve_ms += milliseconds(begin);
        total.report.iterations += outcome.iterations;
        total.report.fallbacks += outcome.fallbacks;
        contact.add_loads(&mut pressed);
        if outcome.converged || tolerance.is_late() {
            tool_loads.add_following(&state.positions, &mut pressed);
            let left = |v: usize| own[v] + pressed[v] - self.internal[v];
            self.grips.note_forces(left, &held.free, state);
            self.tool_loads = pressed;
            total.converged_by.push(outcome.method);
        } else {
            let external: Vec<_> = own.iter().zip(&pressed).map(|(a, b)| a + b).collect();
            let problem = Problem {
                body: &mut state.body,
                forces: &*self.forces,
                inertia,
                external: &external,
                free: &held.free,
                constraints,
                pushes: None,
                following: &tool_loads.following,
                inverse: &applied,
            };
            let forces = missed::unbalanced(problem, &state.positions, &tolerance);
            total.missed = missed::worst(state, &forces);
        }
        let (solve_ms, error) = applied.end();
        total.solve_ms.extend(solve_ms);
        match error {
            // A non-finite residual is a failed attempt, which a shorter step may cure.
            Some(SimError::Inverse(InverseError::NotFinite { .. })) | None => Ok(outcome),
            Some(error) => Err(error),
        }
    }

    /// How many iterations a step that has come so far may still make, but for those `kept`.
    fn iterations_left(&self, total: &StepOutcome, kept: usize) -> usize {
        self.rules.step_iterations.saturating_sub(total.report.iterations + kept)
    }

    /// When an attempt has converged, or has to end in a step that has come so far.
    fn tolerance(&self, total: &StepOutcome, kept: usize) -> Tolerance {
        let max_iterations = self.rules.max_iterations.min(self.iterations_left(total, kept));
        Tolerance { residual: self.rules.residual, max_iterations, deadline: self.deadline }
    }

    /// Moves the free vertices to where a whole step probably takes them. Returns which share of
    /// their last growth the probes' forces start with.
    fn predict(&mut self, moves: Vec<Move>, state: &mut BodyState) -> f64 {
        match &self.motion {
            Some(motion) => {
                motion.coast(&*self.forces, state, &mut self.internal);
                0.0
            }
            None => self.predictor.follow(moves, state, self.step_s),
        }
    }

    /// How the tools that hold or press the body go from where it was followed to, to where they are at time `t`.
    fn moves(
        &self,
        tools: &[Box<dyn Tool>],
        held: &Held<'_>,
        t: f64,
        state: &BodyState,
    ) -> Vec<Move> {
        let from = self.reached_s;
        let holds = |tool: usize| state.grip_tools.contains(&Some(tool)) || held.is_by(tool);
        let of_tool = |number: usize| {
            let tool = &tools[number];
            let has = tool.acts_at(t) && (tool.obstacle(t).is_some() || holds(number));
            let way = tool.reference(t) - tool.reference(from);
            let turn = (tool.pose(t).rotation / tool.pose(from).rotation).scaled_axis();
            let by = [way.x, way.y, way.z, turn.x, turn.y, turn.z];
            has.then_some((number, Vector6::from(by)))
        };
        (0..tools.len()).filter_map(of_tool).collect()
    }

    /// The probes that act at time `t`.
    fn probing(&self, tools: &[Box<dyn Tool>], t: f64) -> Vec<Probing> {
        let probes = tools.iter().enumerate().filter_map(|(tool, one)| {
            let sphere = one.obstacle(t)?;
            let moved = sphere.centre - one.reference(self.reached_s);
            Some(Probing { tool, sphere, moved })
        });
        probes.collect()
    }

    /// Renews rotations and internal forces at the current positions.
    fn evaluate_forces(&mut self, state: &mut BodyState) {
        self.internal.resize(state.positions.len(), Vector3::zeros());
        let inertia = self.motion.as_ref().and_then(Motion::inertia);
        let BodyState { body, positions, .. } = state;
        forces_with_inertia(&*self.forces, inertia, body, positions, &mut self.internal);
    }

    /// Loads at time `t` within `step`: weight, and what tools have just let go of.
    fn loads(&self, state: &BodyState, step: Span, t: f64) -> Vec<Vector3<f64>> {
        let mut loads = self.weights(state, t);
        for (v, force) in &self.fading {
            loads[v.index()] += step.left_at(t) * force;
        }
        loads.iter_mut().zip(self.easing.loads()).for_each(|(load, eased)| *load += eased);
        if let Some(motion) = &self.motion {
            motion.ease_in(step, t, &mut loads);
        }
        loads
    }

    /// Weight of each vertex: a quarter of each element's mass; it grows over the first step.
    pub fn weights(&self, state: &BodyState, t: f64) -> Vec<Vector3<f64>> {
        let mut weights = vec![Vector3::zeros(); state.positions.len()];
        let gravity = self.gravity * (t / self.step_s).min(1.0);
        if gravity == Vector3::zeros() {
            return weights;
        }
        for element in state.body.elements() {
            let density = state.cell(element.tet).density_kg_m3;
            let mass = element.geometry.volume * density;
            for v in element.vertices {
                weights[v] += 0.25 * mass * gravity;
            }
        }
        weights
    }

    /// What holds vertices that are not free at the last equilibrium, N by vertex number; none where changes
    /// of the mesh are felt at once.
    pub fn holding(&self, state: &BodyState) -> Option<Vec<Vector3<f64>>> {
        if !self.easing.is_wanted() {
            return None;
        }
        let is_held = |v: &VertexId| state.holds[v.index()] != Hold::Free;
        let held: Vec<VertexId> = state.vertices().filter(is_held).collect();
        let mut holding = vec![Vector3::zeros(); state.positions.len()];
        let reactions = self.reaction(state, &held, self.reached_s);
        held.iter().zip(reactions).for_each(|(v, force)| holding[v.index()] = force);
        Some(holding)
    }

    /// Keeps a body that stays where it is while its mesh changes in balance with what acts on it, and with what
    /// holds it (N by vertex number): what is missing is taken away in the steps after. Cost: an evaluation of
    /// internal forces.
    pub fn ease(
        &mut self,
        mut holding: Vec<Vector3<f64>>,
        exchanges: &[Exchange],
        acting: &mut Acting<'_>,
    ) {
        let Acting { state, contact, tools, .. } = acting;
        holding.resize(state.positions.len(), Vector3::zeros());
        exchanges.iter().filter(|one| !one.is_split).for_each(|one| {
            one.hand_on(&mut holding);
        });
        self.evaluate_forces(state);
        let mut acts = self.weights(state, self.reached_s);
        for tool in tools.iter().filter(|tool| tool.acts_at(self.reached_s)) {
            tool.add_loads(state, self.reached_s, &mut acts);
        }
        contact.follow(tools);
        contact.add_loads(&mut acts);
        self.grips.add_means(state, &mut acts);
        let missing = self.internal.iter().zip(&acts).zip(&holding);
        self.easing.begin(missing.map(|((inside, acts), holds)| inside - acts - holds).collect());
    }

    /// Internal minus external force on vertices at the last solve, at time `t`, N.
    pub fn reaction(&self, state: &BodyState, vertices: &[VertexId], t: f64) -> Vec<Vector3<f64>> {
        let weights = self.weights(state, t);
        let of = |loads: &[Vector3<f64>], v: usize| loads.get(v).copied().unwrap_or_default();
        let force = |v: &VertexId| {
            let v = v.index();
            self.internal[v] - weights[v] - of(&self.tool_loads, v) - of(self.easing.loads(), v)
        };
        vertices.iter().map(force).collect()
    }
}
