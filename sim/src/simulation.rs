//! The time loop: tools, equilibrium, indicator, splits and merges, inverse.

use std::time::Instant;

use nalgebra::Vector3;
use yawara_corot::{Corotation, Equilibrium};
use yawara_embed::Embedding;
use yawara_mesh::volume::Grid;
use yawara_mesh::{Lattice, VertexId};

use crate::error::SimError;
use crate::frame;
use crate::indicator::Indicator;
use crate::inverse_link::InverseLink;
use crate::plan;
use crate::refinement::{Adaptive, Remeshed, milliseconds};
use crate::report::{Frame, PlanRow, StageTimes, StepReport, Summary};
use crate::scene::Scene;
use crate::setup::Setup;
use crate::solve::Span;
use crate::stages::Stages;
use crate::tally::Tally;
use crate::tools::{Grab, Hold};

/// A body, its tools and the stages that move it.
pub struct Simulation {
    pub(crate) scene: Scene,
    pub(crate) corotation: Box<dyn Corotation>,
    pub(crate) equilibrium: Box<dyn Equilibrium>,
    indicator: Box<dyn Indicator>,
    plan: Vec<PlanRow>,
    grid: Grid,
    label_values: Vec<i64>,
    pub(crate) tools: Vec<Grab>,
    pub(crate) state: Adaptive,
    pub(crate) inverse: InverseLink,
    /// Gravity in solver axes, m/s².
    pub(crate) gravity: Vector3<f64>,
    /// Internal forces at the last solve, by vertex number, N.
    pub(crate) internal: Vec<Vector3<f64>>,
    /// Time up to which equilibrium has been followed, s: behind the clock after a failed step.
    pub(crate) reached_s: f64,
    /// Forces that a tool has just let go of; they fade to zero within the step of the release.
    pub(crate) fading: Vec<(VertexId, Vector3<f64>)>,
    pub(crate) tally: Tally,
}

impl Simulation {
    /// Reads the image, homogenises its material, assembles and inverts the start mesh.
    ///
    /// # Errors
    /// [`SimError`] for a scene that can't be simulated; nothing is written.
    pub fn new(scene: &Scene, stages: Stages) -> Result<Self, SimError> {
        let begin = Instant::now();
        scene.validate(&scene.name)?;
        let setup = Setup::new(scene)?;
        let (tools, holds) = Grab::all(scene, &setup)?;
        let plan = plan::rows(scene, &setup, &stages);
        let Setup { grid, label_values, tree, forest, placement, materials, organ, .. } = setup;
        let regions = scene.fixed.clone();
        let is_fixed = Box::new(move |x: &Vector3<f64>| {
            regions.iter().any(|region| region.contains(&organ, x))
        });
        let Stages { homogenisation, corotation, equilibrium, indicator, inverse } = stages;
        let embedding = Embedding::new(tree, materials, homogenisation)?;
        let state = Adaptive::new(forest, embedding, placement, holds, is_fixed);
        let free: Vec<VertexId> =
            state.forest.vertices().filter(|v| state.holds[v.index()] != Hold::Fixed).collect();
        let capacity = state.forest.vertex_capacity();
        let key = |v| Lattice::key(state.forest.point(v));
        let inverse = InverseLink::new(&state.body, free, capacity, key, &inverse)?;
        Ok(Self {
            gravity: grid.rotation.transpose() * Vector3::from(scene.gravity_m_s2),
            scene: scene.clone(),
            corotation,
            equilibrium,
            indicator,
            plan,
            grid,
            label_values,
            tools,
            internal: vec![Vector3::zeros(); capacity],
            tally: Tally::new(begin, &state),
            state,
            inverse,
            reached_s: 0.0,
            fading: Vec::new(),
        })
    }

    /// What runs, what does not, and why.
    pub fn plan(&self) -> &[PlanRow] {
        &self.plan
    }

    /// Steps still to be made.
    pub fn steps_left(&self) -> usize {
        self.scene.time.steps.saturating_sub(self.tally.steps())
    }

    /// One step: move the tools, find equilibrium, refine and merge. A step that does not
    /// converge is reported, not an error.
    ///
    /// # Errors
    /// [`SimError::Inverse`] if an update of the inverse fails.
    pub fn step(&mut self) -> Result<StepReport, SimError> {
        let begin = Instant::now();
        let step = self.tally.steps() + 1;
        let step_s = self.scene.time.step_s;
        let span = Span { from: self.reached_s, to: step as f64 * step_s };
        let mut times = StageTimes::default();
        self.let_go(span);
        let outcome = self.advance(span, &mut times)?;
        let force = self.tool_force(self.reached_s);
        // What is no equilibrium says nothing about where to refine.
        let remeshed =
            if outcome.converged { self.remesh(step, &mut times)? } else { Remeshed::default() };
        if remeshed.splits + remeshed.merges > 0 {
            self.inverse.watch_drift(self.scene.seed.wrapping_add(step as u64));
        }
        let report = StepReport {
            step,
            time_s: span.to,
            vertices: self.state.forest.vertex_count(),
            tets: self.state.forest.leaf_count(),
            splits: remeshed.splits,
            merges: remeshed.merges,
            iterations: outcome.iterations,
            substeps: outcome.substeps,
            residual: outcome.residual,
            converged: outcome.converged,
            force_n: (self.grid.rotation * force).into(),
            times,
        };
        self.tally.add(&report, &self.state, milliseconds(begin));
        Ok(report)
    }

    /// True where the scene may refine at all.
    fn refines(&self) -> bool {
        self.scene.mesh.max_level > self.scene.mesh.start_level
    }

    fn remesh(&mut self, step: usize, times: &mut StageTimes) -> Result<Remeshed, SimError> {
        if !self.refines() {
            return Ok(Remeshed::default());
        }
        let max_vertices = self.scene.mesh.max_vertices;
        self.state.remesh(
            step,
            &self.scene.refinement,
            max_vertices,
            self.indicator.as_ref(),
            &mut self.inverse,
            times,
        )
    }

    /// Frees the vertices of tools that let go before `span` ends; their reactions fade out.
    fn let_go(&mut self, span: Span) {
        let leaving: Vec<VertexId> = self
            .state
            .forest
            .vertices()
            .filter(|v| match self.state.holds[v.index()] {
                Hold::Grabbed(tool) => !self.tools[tool].holds_at(span.to),
                Hold::Free | Hold::Fixed => false,
            })
            .collect();
        if leaving.is_empty() {
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

    /// The current mesh with its fields, for output.
    pub fn frame(&self) -> Frame {
        let time_s = self.tally.steps() as f64 * self.scene.time.step_s;
        frame::capture(&self.state, &self.grid, &self.label_values, time_s)
    }

    /// Everything that happened so far.
    pub fn summary(&self) -> Summary {
        self.tally.summary(&self.scene, &self.plan, &self.inverse)
    }
}
