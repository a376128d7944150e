//! The time loop: tools, equilibrium, indicator, splits and merges, inverse.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use yawara_corot::{Equilibrium, InternalForces};
use yawara_embed::{Embedding, dynamic_by_name, formulation_by_name};
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{Lattice, TetId, VertexId};

use super::contact::ContactState;
use super::dynamics::{self, Motion};
use super::equilibrium::Span;
use super::indicator::Indicator;
use super::predictor::Predictor;
use super::refinement::{Demand, Refiner, Remeshed};
use crate::body::{BodyState, Hold, ImageBody, Origin, ScannerAxes, Start};
use crate::choice::{Stages, empty_body, of_scene, plan};
use crate::error::SimError;
use crate::inverse::InverseLink;
use crate::report::{
    BodySummary, Frame, PlanRow, RunStatistics, StageTimes, StepReport, Summary, Surfaces, capture,
    milliseconds,
};
use crate::scene::Scene;
use crate::tools::{self, Regions, Tool};

/// A body, its tools and the stages that move it.
pub struct Simulation {
    pub(crate) scene: Scene,
    pub(crate) corotation: Box<dyn InternalForces>,
    pub(crate) equilibrium: Box<dyn Equilibrium>,
    indicator: Box<dyn Indicator>,
    plan: Vec<PlanRow>,
    pub(crate) axes: ScannerAxes,
    /// None for a mesh from a file.
    body_summary: Option<BodySummary>,
    /// The labels, if fields are to be written on their grid.
    pub(crate) volume: Option<Arc<LabelVolume>>,
    pub(crate) tools: Vec<Box<dyn Tool>>,
    /// Contacts at the last equilibrium.
    pub(crate) contact: ContactState,
    /// Forces of tools on vertices at the last equilibrium, by vertex number, N; shorter by those
    /// that have come in since.
    pub(crate) tool_loads: Vec<Vector3<f64>>,
    /// Force of the fixed vertices on the body at the last equilibrium, N.
    pub(crate) support: Vector3<f64>,
    pub(crate) state: BodyState,
    /// None for a mesh from a file.
    pub(crate) refiner: Option<Refiner>,
    surfaces: Option<Surfaces>,
    pub(crate) inverse: InverseLink,
    /// Gravity in solver axes, m/s².
    pub(crate) gravity: Vector3<f64>,
    /// Internal forces at the last solve, by vertex number, N.
    pub(crate) internal: Vec<Vector3<f64>>,
    /// Time up to which equilibrium has been followed, s: behind the clock after a failed step.
    pub(crate) reached_s: f64,
    /// What a pressed body did in the last step.
    pub(crate) predictor: Predictor,
    /// None for a quasi-static scene.
    pub(crate) motion: Option<Motion>,
    /// Forces that a tool has just let go of; they fade to zero within the step of the release.
    pub(crate) fading: Vec<(VertexId, Vector3<f64>)>,
    pub(crate) statistics: RunStatistics,
}

impl Simulation {
    /// Reads the image, homogenises its material, assembles and inverts the start mesh.
    ///
    /// # Errors
    /// [`SimError`] for a scene that can't be simulated; nothing is written.
    pub fn new(scene: &Scene, stages: Stages) -> Result<Self, SimError> {
        Self::with_progress(scene, stages, &mut |_| ControlFlow::Continue(()))
    }

    /// As [`new`](Self::new); a homogenisation that solves the whole fine body tells `progress` the
    /// fraction done, and stops where that says so.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`EmbedError::Stopped`](yawara_embed::EmbedError::Stopped).
    pub fn with_progress(
        scene: &Scene,
        stages: Stages,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, SimError> {
        let begin = Instant::now();
        scene.validate(&scene.name)?;
        let element = of_scene(scene, &stages)?;
        let start = Start::new(scene)?;
        let (mut tools, holds) = tools::all(scene, &start)?;
        let mut plan = plan::rows(scene, &start, &stages, element);
        let Start { axes, organ, origin, .. } = start;
        let Stages { homogenisation, corotation, equilibrium, indicator, inverse } = stages;
        let (mut body_summary, mut volume) = (None, None);
        let (mut state, refiner, surfaces) = match origin {
            Origin::MeshFile(mesh) => (mesh.state(&holds, empty_body(element)), None, None),
            Origin::Image(mut setup) => {
                let materials = std::mem::take(&mut setup.materials);
                let tree = Arc::clone(&setup.tree);
                let embedding =
                    Embedding::with_materials(tree, materials.into(), homogenisation, progress)?;
                plan::homogenised(&mut plan, &embedding);
                let surfaces = Surfaces::new(scene, &setup, &embedding)?;
                let ImageBody { forest, placement, .. } = *setup;
                let label_values = setup.volume.values().to_vec();
                body_summary = Some(setup.summary);
                let labels = Arc::new(setup.volume);
                volume = scene.output.field.then(|| Arc::clone(&labels));
                let (refiner, state) = Refiner::new(
                    forest,
                    embedding,
                    placement,
                    label_values,
                    &holds,
                    Regions::of(scene, organ, labels),
                    empty_body(element),
                );
                (state, Some(refiner), surfaces)
            }
        };
        let is_fixed = |v: usize| state.holds[v] == Hold::Fixed;
        let key = |v: VertexId| match &refiner {
            Some(refiner) => Lattice::key(refiner.forest.point(v)),
            None => organ.grid_key(&state.rest[v.index()]),
        };
        let formulation = match dynamics::weights(scene)? {
            Some(weights) => dynamic_by_name(element, weights)?,
            None => formulation_by_name(element)?,
        };
        let density = |tet| state.cell(tet).density_kg_m3;
        let (body, vertices) = (&state.body, state.vertices());
        let inverse = InverseLink::with_densities(
            body,
            &density,
            formulation,
            vertices,
            is_fixed,
            key,
            &inverse,
        )?;
        let motion = Motion::new(scene, &axes, &mut state)?;
        plan.push(plan::inverse(scene, &inverse));
        tools
            .iter_mut()
            .filter_map(|tool| tool.surface_points_mut())
            .for_each(|skin| skin.bind(&state));
        Ok(Self {
            gravity: axes.to_solver_direction(&Vector3::from(scene.gravity_m_s2)),
            scene: scene.clone(),
            corotation,
            equilibrium,
            indicator,
            plan,
            axes,
            body_summary,
            volume,
            tools,
            contact: ContactState::default(),
            predictor: Predictor::default(),
            tool_loads: Vec::new(),
            support: Vector3::zeros(),
            internal: vec![Vector3::zeros(); state.vertex_capacity()],
            statistics: RunStatistics::new(begin, &state),
            state,
            refiner,
            surfaces,
            inverse,
            reached_s: 0.0,
            motion,
            fading: Vec::new(),
        })
    }

    /// What runs, what does not, and why.
    pub fn plan(&self) -> &[PlanRow] {
        &self.plan
    }

    pub(crate) fn axes(&self) -> &ScannerAxes {
        &self.axes
    }

    /// The scene's name.
    pub fn name(&self) -> &str {
        &self.scene.name
    }

    /// Steps still to be made.
    pub fn steps_left(&self) -> usize {
        self.scene.time.steps.saturating_sub(self.statistics.steps())
    }

    /// Time at the end of the next step, s.
    pub(crate) fn step_end(&self) -> f64 {
        (self.statistics.steps() + 1) as f64 * self.scene.time.step_s
    }

    /// One step: move the tools, find equilibrium, refine and merge. A step that does not
    /// converge is reported, not an error.
    ///
    /// # Errors
    /// [`SimError::Inverse`] if an update of the inverse fails.
    pub fn step(&mut self) -> Result<StepReport, SimError> {
        let begin = Instant::now();
        let step = self.statistics.steps() + 1;
        let span = Span { from: self.reached_s, to: self.step_end() };
        let mut times = StageTimes::default();
        self.let_go(span);
        let outcome = self.advance(span, &mut times)?;
        self.support = self.measured_support();
        let felt = self.tool_reports();
        let force_n = [0, 1, 2].map(|axis| felt.iter().map(|tool| tool.force_n[axis]).sum());
        // What is no equilibrium says nothing about where to refine.
        let remeshed = if outcome.converged {
            self.remesh(step, begin, &mut times)?
        } else {
            Remeshed::default()
        };
        if remeshed.splits + remeshed.merges > 0 {
            self.inverse.watch(self.scene.seed.wrapping_add(step as u64))?;
            let skins = self.tools.iter_mut().filter_map(|tool| tool.surface_points_mut());
            skins.for_each(|skin| skin.bind(&self.state));
        }
        let report = StepReport {
            step,
            time_s: span.to,
            vertices: self.state.vertex_count(),
            tets: self.state.tet_count(),
            splits: remeshed.splits,
            merges: remeshed.merges,
            waiting: self.refiner.as_ref().map_or(0, Refiner::waiting),
            iterations: outcome.iterations,
            substeps: outcome.substeps,
            fallbacks: outcome.fallbacks,
            residual: outcome.residual,
            converged: outcome.converged,
            force_n,
            tools: felt,
            times,
        };
        self.statistics.add(&report, &self.state, milliseconds(begin));
        Ok(report)
    }

    /// The splits and merges of a step that began at `begin`.
    fn remesh(
        &mut self,
        step: usize,
        begin: Instant,
        times: &mut StageTimes,
    ) -> Result<Remeshed, SimError> {
        let Some(refiner) = self.refiner.as_mut().filter(|_| self.scene.mesh.refines()) else {
            return Ok(Remeshed::default());
        };
        let budget = &self.scene.budget;
        let allowed = budget.step_ms.filter(|_| budget.realtime);
        let demand = Demand {
            deadline: allowed.map(|ms| begin + Duration::from_secs_f64(ms * 1e-3)),
            rules: &self.scene.refinement,
            max_vertices: self.scene.mesh.max_vertices,
            indicator: self.indicator.as_ref(),
        };
        refiner.remesh(&mut self.state, step, &demand, &mut self.inverse, times)
    }

    /// Frees the vertices of tools that let go before `span` ends; their reactions fade out.
    fn let_go(&mut self, span: Span) {
        let leaving: Vec<VertexId> = self
            .state
            .vertices()
            .filter(|v| match self.state.holds[v.index()] {
                Hold::Grabbed(tool) => !self.tools[tool].acts_at(span.to),
                Hold::Free | Hold::Fixed => false,
            })
            .collect();
        if leaving.is_empty() {
            return;
        }
        if self.motion.is_some() {
            // Inertia takes the place of the hold: there is nothing to follow slowly.
            for v in leaving {
                self.state.holds[v.index()] = Hold::Free;
            }
            return;
        }
        // Vertices may have come in since the last solve.
        self.evaluate_forces();
        let reactions = self.reaction(&leaving, span.from);
        for &v in &leaving {
            self.state.holds[v.index()] = Hold::Free;
        }
        self.fading.extend(leaving.into_iter().zip(reactions));
    }

    /// The current mesh with its fields and surfaces, for output.
    ///
    /// # Errors
    /// [`SimError::Surface`] if a position is not finite.
    pub fn frame(&self) -> Result<Frame, SimError> {
        let time_s = self.statistics.steps() as f64 * self.scene.time.step_s;
        let measured = self.refiner.as_ref().map(|refiner| |tet| refiner.measured(tet));
        let indicator = measured.as_ref().map(|measured| measured as &dyn Fn(TetId) -> f64);
        let mut frame = capture(&self.state, &self.axes, indicator, time_s);
        if let (Some(surfaces), Some(refiner)) = (&self.surfaces, &self.refiner) {
            frame.surfaces = surfaces.frames(&refiner.forest, &self.state.positions, &self.axes)?;
        }
        Ok(frame)
    }

    /// Everything that happened so far.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn summary(&self) -> Result<Summary, SimError> {
        let surfaces = match (&self.surfaces, &self.refiner) {
            (Some(surfaces), Some(refiner)) => {
                surfaces.summary(&refiner.forest, &self.state.positions)?
            }
            _ => Vec::new(),
        };
        let body = self.body_summary.as_ref();
        let mut summary =
            self.statistics.summary(&self.scene, &self.plan, body, &self.inverse, surfaces);
        summary.motion = self.momentum();
        Ok(summary)
    }
}
