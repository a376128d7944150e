//! The loop over steps: tools, equilibrium, indicator, splits and merges, inverse.

use std::time::{Duration, Instant};

use nalgebra::Vector3;
use yawara_mesh::bisection::lattice::MAX_LEVEL;
use yawara_mesh::{BisectionForest, TetId, VertexId};

use super::beginning::Beginning;
use super::contact::ContactState;
use super::equilibrium::{Acting, StepSolver};
use super::figures::Figure;
use super::holding::Coming;
use super::ledger::Ledger;
use super::proximity::Proximity;
use super::refinement::{Refiner, Remeshed, Round, Turn};
use super::span::Span;
use super::stood::Stood;
use super::tool_forces::ToolForces;
use crate::body::{BodyState, ScannerAxes, Start, pieces};
use crate::error::SimError;
use crate::inverse::{Elements, InverseLink};
use crate::report::{
    Failure, Fields, Frame, Momentum, PlanRow, Probe, Recorder, StepReport, Summary, ToolReport,
    milliseconds,
};
use crate::scene::{Scene, ToolEntry};
use crate::tools::{Pose, Tool, path_of};

/// A body, its tools and the stages that move it.
pub struct Simulation {
    pub(super) scene: Scene,
    pub(super) body: SimulatedBody,
    pub(super) tools: Vec<Box<dyn Tool>>,
    pub(super) contact: ContactState,
    pub(super) solver: StepSolver,
    /// The figure that the scene is about, if it names one.
    pub(super) goal: Option<Figure>,
    /// What tools that begin later are going to hold.
    pub(super) coming: Coming,
    /// What the state was made from; none unless the scene asks for checkpoints.
    pub(super) beginning: Option<Beginning>,
    /// The body at rest, read again when the first tool is added.
    pub(super) rest: Option<Box<Start>>,
    pub(super) recorder: Recorder,
    pub(super) ledger: Ledger,
    /// Force of the fixed vertices on the body at the last equilibrium, solver axes, N.
    pub(super) support: Vector3<f64>,
    /// Whether labels have changed since their surfaces were cut.
    pub(super) are_surfaces_stale: bool,
    /// What the last step that measured found.
    pub(super) stood: Option<Stood>,
}

/// The body with what keeps its stiffness inverted and its mesh as fine as needed.
pub(super) struct SimulatedBody {
    pub state: BodyState,
    pub inverse: InverseLink,
    /// None for a mesh from a file.
    pub refiner: Option<Refiner>,
}

impl Simulation {
    /// What runs, what does not, and why.
    pub fn plan(&self) -> &[PlanRow] {
        &self.recorder.plan
    }

    /// The scene's name.
    pub fn name(&self) -> &str {
        &self.scene.name
    }

    /// The body as it is now.
    pub fn body(&self) -> &BodyState {
        &self.body.state
    }

    /// The mesh that the body is refined on; none for a mesh from a file.
    pub fn forest(&self) -> Option<&BisectionForest> {
        self.body.refiner.as_ref().map(|refiner| &refiner.content.forest)
    }

    /// The inverse that is kept, of the body at rest.
    pub fn inverse(&self) -> &InverseLink {
        &self.body.inverse
    }

    /// Its tools: those of the scene, then those given to the builder, then those added since.
    pub fn tools(&self) -> impl Iterator<Item = &dyn Tool> {
        self.tools.iter().map(AsRef::as_ref)
    }

    /// How solver axes lie in the scanner.
    pub fn axes(&self) -> ScannerAxes {
        self.recorder.axes
    }

    /// Steps still to be made.
    pub fn steps_left(&self) -> usize {
        self.scene.time.steps.saturating_sub(self.recorder.statistics.steps())
    }

    /// Time at the end of step number `step`, s.
    pub(super) fn time_after(&self, step: usize) -> f64 {
        step as f64 * self.scene.time.step_s
    }

    /// The part of time that the next step is to cover.
    fn next_span(&self) -> Span {
        let step = self.recorder.statistics.steps() + 1;
        Span { from: self.solver.reached_s(), to: self.time_after(step) }
    }

    /// One step: move the tools, find equilibrium, refine and merge. A step that does not
    /// converge is reported, not an error.
    /// # Errors
    /// [`SimError::Inverse`] if an update of the inverse fails.
    pub fn step(&mut self) -> Result<StepReport, SimError> {
        let begin = Instant::now();
        let step = self.recorder.statistics.steps() + 1;
        let span = self.next_span();
        if step == 1 {
            self.begin_fine()?;
        }
        self.take_hold(span.to)?;
        let Self { body, tools, contact, solver, .. } = self;
        self.ledger.begin(solver, &body.state, tools);
        solver.let_go(span, &mut body.state, &mut body.inverse, tools)?;
        let mut acting = Acting { state: &mut body.state, contact, tools, inverse: &body.inverse };
        let budget = &self.scene.budget;
        let allowed = budget.step_ms.filter(|_| budget.realtime);
        let deadline = allowed.map(|ms| begin + Duration::from_secs_f64(ms * 1e-3));
        let mut outcome = solver.advance(span, &mut acting, deadline)?;
        let felt = self.felt();
        let (support, mut reports) = (felt.support(), felt.reports(&self.tools));
        self.support = support;
        let Self { body, tools, contact, solver, recorder, ledger, .. } = self;
        ledger.end(solver, &body.state, contact, tools, recorder.axes, &mut reports);
        let force_n = [0, 1, 2].map(|axis| reports.iter().map(|tool| tool.force_n[axis]).sum());
        // What is no equilibrium says nothing about where to refine.
        let remeshed = match outcome.report.converged {
            true => self.remesh(step, deadline, &mut reports, &mut outcome.report)?,
            false => Remeshed::default(),
        };
        let SimulatedBody { state, refiner, .. } = &mut self.body;
        outcome.report = StepReport {
            step,
            time_s: span.to,
            vertices: state.vertex_count(),
            tets: state.tet_count(),
            splits: remeshed.splits,
            merges: remeshed.merges,
            waiting: refiner.as_ref().map_or(0, Refiner::waiting),
            force_n,
            tools: reports,
            ..outcome.report
        };
        if let (false, Some(missed)) = (outcome.report.converged, outcome.missed) {
            let (reached_s, axes) = (self.solver.reached_s(), self.recorder.axes);
            let failure = Failure::new(&outcome.report, &missed, reached_s, &self.scene, axes);
            outcome.report.failure = Some(failure);
        }
        let (edited, splits) = self.edit(span)?;
        outcome.report.splits += splits;
        outcome.report.edits = edited.len();
        for one in edited.iter().filter(|one| one.work_j > 0.0) {
            outcome.report.tools[one.tool].force_n = one.force_n;
        }
        let state = &self.body.state;
        (outcome.report.vertices, outcome.report.tets) = (state.vertex_count(), state.tet_count());
        if self.is_written(step) {
            self.renew_surfaces()?;
        }
        self.recorder.statistics.add(&outcome, &self.body.state, milliseconds(begin));
        self.recorder.statistics.edit(&edited);
        Ok(outcome.report)
    }

    /// Whether what is after a step is written.
    fn is_written(&self, step: usize) -> bool {
        step.is_multiple_of(self.scene.output.frames_every) || self.scene.time.steps == step
    }

    /// Refines the mesh at rest where a probe is about to touch.
    fn begin_fine(&mut self) -> Result<(), SimError> {
        let rule = self.body.refiner.as_ref().and_then(Refiner::near_probe);
        match Proximity::of(rule, &self.tools, self.solver.reached_s()) {
            Some(near) => self.make_fine(&near).map(|_| ()),
            None => Ok(()),
        }
    }

    /// Refines the mesh as finely as `near` wants, whatever it takes; returns how many vertices came in.
    pub(super) fn make_fine(&mut self, near: &Proximity) -> Result<usize, SimError> {
        Ok(self.between_steps(|refiner, round| refiner.make_fine(near, round))?.splits)
    }

    /// Bisects these tetrahedra, numbered as in a [frame](Self::frame), between two steps, and before them those that
    /// have to be for the mesh to fit together; returns how many vertices came in. What is as fine as
    /// `mesh.max_level` allows stays, and so does all of a mesh from a file; `mesh.max_vertices` holds.
    ///
    /// Cost: as of so many splits in a step, each O(1) in the mesh, and one batch of the inverse.
    /// # Errors
    /// [`SimError::Value`] for a number that no tetrahedron has; nothing has changed then.
    /// [`SimError::Inverse`].
    pub fn split(&mut self, tets: &[usize]) -> Result<usize, SimError> {
        let elements = self.body.state.elements_by_number().into_iter();
        let of_frame: Vec<TetId> = elements.map(|(_, element)| element.tet).collect();
        let chosen = self.chosen("tetrahedra", tets, &of_frame)?;
        Ok(self.between_steps(|refiner, round| refiner.split_now(&chosen, round))?.splits)
    }

    /// Takes these vertices, numbered as in a [frame](Self::frame), out of the mesh between two steps, where they are the
    /// midpoint of an edge that is bisected and no younger vertex needs them; returns how many went. What tools hold stays.
    ///
    /// Cost: as [`split`](Self::split).
    /// # Errors
    /// As [`split`](Self::split).
    pub fn merge(&mut self, vertices: &[usize]) -> Result<usize, SimError> {
        let of_frame: Vec<VertexId> = self.body.state.vertices().collect();
        let chosen = self.chosen("vertices", vertices, &of_frame)?;
        Ok(self.between_steps(|refiner, round| refiner.merge_now(&chosen, round))?.merges)
    }

    /// Those of `all` that have these numbers.
    fn chosen<T: Copy>(&self, key: &str, numbers: &[usize], all: &[T]) -> Result<Vec<T>, SimError> {
        let of = |&number: &usize| {
            let want = format!("below {}", all.len());
            all.get(number)
                .copied()
                .ok_or_else(|| SimError::value(&self.scene.name, key, number, want))
        };
        numbers.iter().map(of).collect()
    }

    /// Changes the mesh otherwise than a step does.
    fn between_steps(
        &mut self,
        change: impl FnOnce(&mut Refiner, &mut Round<'_>) -> Result<(), SimError>,
    ) -> Result<Remeshed, SimError> {
        let Self { body, tools, contact, solver, ledger, .. } = self;
        let SimulatedBody { state, inverse, refiner: Some(refiner) } = body else {
            return Ok(Remeshed::default());
        };
        let step = self.recorder.statistics.steps();
        ledger.look(solver, state, tools);
        let (turns, done) = (solver.turns(), Remeshed::default());
        let mut round = Round { state, inverse, tools, step, deadline: None, turns, done };
        change(refiner, &mut round)?;
        let remeshed = round.done;
        if remeshed.splits + remeshed.merges > 0 {
            ledger.remeshed(&remeshed, solver, state, contact, tools);
            self.follow()?;
        }
        Ok(remeshed)
    }

    /// The estimates of a step, and what the mesh wants, then its splits and merges, no splits after a `deadline`.
    fn remesh(
        &mut self,
        step: usize,
        deadline: Option<Instant>,
        felt: &mut [ToolReport],
        report: &mut StepReport,
    ) -> Result<Remeshed, SimError> {
        let refines = self.scene.mesh.refines();
        let turn = refines.then(|| Turn::of(step, self.scene.measured_every()));
        let ranks = turn.is_some_and(|turn| turn.measures);
        let mut done = Remeshed::default();
        if ranks || self.is_written(step) {
            done.stored_j = self.measure(step, ranks, felt, report)?;
        }
        let Self { body, tools, solver, ledger, .. } = self;
        let SimulatedBody { state, inverse, refiner } = body;
        let mut remeshed = done;
        let mut holding = None;
        if let (Some(refiner), true) = (refiner, turn.is_some_and(|turn| turn.changes))
            && refiner.wants_changes()
        {
            holding = solver.holding(state);
            ledger.look(solver, state, tools);
            let (turns, done) = (solver.turns(), remeshed);
            let mut round = Round { state, inverse, tools, step, deadline, turns, done };
            remeshed = refiner.remesh(&mut round, &mut report.times)?;
        }
        if remeshed.splits + remeshed.merges > 0 {
            let elements = Elements { body: &state.body, density: &|tet| state.density(tet) };
            inverse.watch(self.scene.seed.wrapping_add(step as u64), &elements)?;
            self.follow()?;
            let Self { body, tools, contact, solver, .. } = self;
            let SimulatedBody { state, inverse, .. } = body;
            if let Some(holding) = holding {
                let mut acting = Acting { state, contact, tools, inverse };
                solver.ease(holding, &remeshed.exchanges, &mut acting);
            }
        }
        let Self { body: SimulatedBody { state, .. }, tools, contact, solver, ledger, .. } = self;
        ledger.remeshed(&remeshed, solver, state, contact, tools);
        Ok(remeshed)
    }

    pub(super) fn felt(&self) -> ToolForces<'_> {
        let Self { body, solver, contact, recorder, .. } = self;
        ToolForces { state: &body.state, solver, contact, axes: recorder.axes }
    }

    /// Leads a tool from where it is to `pose` over the next step, in place of its path; it stays
    /// there until it is led elsewhere. Results are those of a path with the same poses.
    /// # Errors
    /// [`SimError::NoSuchTool`] if there is none of that number or it does not move (a pressure, a load);
    /// [`SimError::Pose`] for values that are not finite or farther than 1000 m. Nothing has
    /// changed then.
    pub fn set_tool_pose(&mut self, tool: usize, pose: Pose) -> Result<(), SimError> {
        let Span { from, to } = self.next_span();
        pose.check(tool)?;
        path_of(&mut self.tools, tool)?.lead(from, to, pose);
        Ok(())
    }

    /// Where a tool is asked to be at time `t`, s: its path, or where it was last led.
    /// # Errors
    /// As [`set_tool_pose`](Self::set_tool_pose).
    pub fn tool_pose(&mut self, tool: usize, t: f64) -> Result<Pose, SimError> {
        Ok(path_of(&mut self.tools, tool)?.pose(t))
    }

    /// How the force of a tool on the body grows with its displacement while what it holds or
    /// pushes stays the same: the inverse of the 3 × 3 compliance that it feels, rows by scanner
    /// axis, N/m, symmetric positive semi-definite. Zero without contact, and for a pressure or a load.
    ///
    /// Grab: Σ_ij (C_pp⁻¹)_ij over the held vertices; probe: N (N Ĉ Nᵀ)⁻¹ Nᵀ over the points it
    /// pushes, N their normals. Ĉ = T C Tᵀ of the last equilibrium. Cost: a block of compliance at
    /// what is held, unless nothing has changed since, and O(k³) for its k columns.
    /// # Errors
    /// [`SimError::NoSuchTool`], [`SimError::Inverse`].
    pub fn tool_stiffness(&self, tool: usize) -> Result<[[f64; 3]; 3], SimError> {
        let count = self.tools.len();
        if tool >= count {
            return Err(SimError::NoSuchTool { tool, reason: "is missing", count });
        }
        self.felt().stiffness(tool, &self.body.inverse)
    }

    /// Σ (f_int − f_ext) over all fixed vertices at the last equilibrium: the force of the support
    /// on the body in scanner axes, N. With the tools' forces and the weight it sums up to nothing.
    pub fn support_force(&self) -> [f64; 3] {
        self.recorder.axes.to_ras_direction(&self.support).into()
    }

    /// Mass, momentum and kinetic energy of a dynamic body; none for a quasi-static one.
    pub fn momentum(&self) -> Option<Momentum> {
        self.solver.momentum(&self.body.state)
    }

    /// Σ ½ V σ : ε in the elements' frames and what elastic supports and pads store, J, where the body
    /// is now. Cost: O(elements).
    pub fn energy_j(&self) -> f64 {
        self.body.state.energy_j()
    }

    /// The current mesh with its fields and surfaces, for output.
    /// # Errors
    /// [`SimError::Surface`] if a position is not finite.
    pub fn frame(&self) -> Result<Frame, SimError> {
        let time_s = self.time_after(self.recorder.statistics.steps());
        let SimulatedBody { state, refiner, .. } = &self.body;
        let forest = refiner.as_ref().map(|refiner| &refiner.content.forest);
        let measured = refiner.as_ref().map(|refiner| |tet| refiner.measured(tet));
        let indicator = measured.as_ref().map(|measured| measured as &dyn Fn(TetId) -> f64);
        self.recorder.frame(state, forest, indicator, time_s)
    }

    /// The current state on the image's grid, or `None` unless the scene sets `output.field`.
    ///
    /// Cost: O(voxels + tetrahedra); 10 bytes per voxel.
    /// # Errors
    /// [`SimError::Image`] where a field is not finite (the state has diverged).
    pub fn fields(&self) -> Result<Option<Fields>, SimError> {
        let volume = self.recorder.volume.as_ref();
        volume.map(|volume| Fields::of(&self.body.state, volume)).transpose()
    }

    /// Everything that happened so far.
    /// # Errors
    /// As [`Self::frame`].
    pub fn summary(&self) -> Result<Summary, SimError> {
        let SimulatedBody { state, inverse, refiner } = &self.body;
        let forest = refiner.as_ref().map(|refiner| &refiner.content.forest);
        let mut summary = self.recorder.summary(&self.scene, state, forest, inverse)?;
        if self.scene.tools.iter().any(ToolEntry::cuts) {
            let pieces = pieces(state).into_iter();
            summary.pieces_cm3 = pieces.map(|piece| 1e6 * piece.volume_m3).collect();
        }
        summary.motion = self.momentum();
        summary.energy = (!self.solver.is_dynamic()).then(|| self.ledger.summary(state));
        Ok(summary)
    }

    /// The vertices of the uniform mesh of `level` on the same base cells, or of the finest level
    /// that this simulation may refine to if that is finer.
    ///
    /// Cost: as the mesh itself, and one combination of halves per heterogeneous tetrahedron.
    /// # Errors
    /// [`SimError::Value`] for a mesh from a file, which has no levels, or a level beyond
    /// [`MAX_LEVEL`]; [`SimError::Bisection`], [`SimError::Embed`].
    pub fn probe(&self, level: u8) -> Result<Probe, SimError> {
        let name = &self.scene.name;
        let Some(Refiner { content, .. }) = &self.body.refiner else {
            let path = format!("{:?}", self.scene.mesh.path);
            let want = "an image: a mesh from a file has no finer levels to measure it on";
            return Err(SimError::value(name, "mesh.path", path, want));
        };
        if level > MAX_LEVEL {
            let want = format!("at most {MAX_LEVEL}");
            return Err(SimError::value(name, "level of the probe", level, want));
        }
        Probe::new(&content.forest, &content.embedding, content.placement, level)
    }

    /// Where the points of `probe` now are, solver axes, m, in the order of [`Probe::rest`].
    ///
    /// Cost: a look at every point; arithmetic only where something has moved.
    /// # Errors
    /// [`SimError::Embed`] if `probe` is of another body.
    pub fn probe_positions(&self, probe: &mut Probe) -> Result<Vec<Vector3<f64>>, SimError> {
        match &self.body.refiner {
            Some(refiner) => probe.follow(&refiner.content.forest, &self.body.state.positions),
            None => Ok(probe.rest().to_vec()),
        }
    }
}
