//! What a run keeps and adds up for its output.

use std::sync::Arc;
use std::time::Instant;

use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{BisectionForest, Quality, TetId};

use super::capture::capture;
use super::failure::Missed;
use super::kept::{KeptStatistics, Names};
use super::records::{
    EstimateSummary, ForceSummary, Frame, InverseSummary, MeshSummary, Percentiles, PlanRow, Range,
    StepReport, StepSummary, Summary,
};
use super::surfaces::{BodyOutline, Surfaces};
use super::tool::{Edited, ToolSummary};
use crate::body::{BodyState, BodySummary, ScannerAxes};
use crate::error::SimError;
use crate::inverse::InverseLink;
use crate::scene::Scene;

/// Rows of the plan about what [`BodySummary::warnings`] tells more of.
const BODY_ROWS: [&str; 2] = ["image", "mesh"];

/// Layout version of [`Summary`].
const SCHEMA: u32 = 1;

/// Takes frames, fields and the summary of a body.
pub(crate) struct Recorder {
    pub axes: ScannerAxes,
    pub plan: Vec<PlanRow>,
    /// None for a mesh from a file.
    pub body: Option<BodySummary>,
    /// The labels, if fields are to be written on their grid.
    pub volume: Option<Arc<LabelVolume>>,
    pub surfaces: Option<Surfaces>,
    pub outline: Option<BodyOutline>,
    pub statistics: RunStatistics,
}

impl Recorder {
    /// The current mesh with its fields and surfaces at `time_s`. `forest` and `indicator`, the last
    /// measurement by tetrahedron, are those of a mesh that can be refined.
    pub fn frame(
        &self,
        state: &BodyState,
        forest: Option<&BisectionForest>,
        indicator: Option<&dyn Fn(TetId) -> f64>,
        time_s: f64,
    ) -> Result<Frame, SimError> {
        let mut frame = capture(state, &self.axes, indicator, time_s);
        if let (Some(surfaces), Some(forest)) = (&self.surfaces, forest) {
            frame.surfaces = surfaces.frames(forest, &state.positions, &self.axes)?;
        }
        if let (Some(outline), Some(forest)) = (&self.outline, forest) {
            frame.outline = outline.frame(forest, &state.positions, &self.axes)?;
        }
        Ok(frame)
    }

    /// Everything that happened so far.
    pub fn summary(
        &self,
        scene: &Scene,
        state: &BodyState,
        forest: Option<&BisectionForest>,
        inverse: &InverseLink,
    ) -> Result<Summary, SimError> {
        let RunStatistics { mesh, worst, steps, step_ms, solve_ms, .. } = &self.statistics;
        let counts = inverse.counts();
        Ok(Summary {
            schema: SCHEMA,
            scene: scene.name.clone(),
            seed: scene.seed,
            made_by: None,
            plan: self.plan.clone(),
            body: self.body.clone(),
            mesh: MeshSummary {
                worst_radius_ratio: worst.radius_ratio,
                worst_circumradius_over_shortest_edge: worst.circumradius_over_shortest_edge,
                ..*mesh
            },
            steps: StepSummary { time_ms: Percentiles::of(step_ms), ..steps.clone() },
            inverse: InverseSummary {
                choice: inverse.maintainer().name().into(),
                updates: inverse.updates,
                rebuilds: counts.rebuilds,
                drift_rebuilds: counts.drift_rebuilds,
                failed_pivots: counts.failed_pivots,
                reassemblies: inverse.reassemblies,
                refinement_steps: counts.refinement_steps,
                batches: inverse.batches,
                time_ms: Percentiles::of(&inverse.update_ms),
                solve_ms: Percentiles::of(solve_ms),
                drift_max: inverse.drift_max,
            },
            error_estimate: self.statistics.estimate,
            force: self.statistics.force,
            energy: None,
            motion: None,
            tools: self.statistics.tools.clone(),
            pieces_cm3: Vec::new(),
            surfaces: match (&self.surfaces, forest) {
                (Some(surfaces), Some(forest)) => surfaces.summary(forest, &state.positions)?,
                _ => Vec::new(),
            },
            warnings: self.warnings(),
            setup_s: self.statistics.setup_s,
            wall_s: self.statistics.wall_s(),
        })
    }
}

impl Recorder {
    /// What is not as the scene asked for, or odd.
    fn warnings(&self) -> Vec<String> {
        let body = self.body.iter().flat_map(BodySummary::warnings);
        let of_plan = |row: &PlanRow| row.warnings().collect::<Vec<_>>();
        let plan = self.plan.iter().filter(|row| !BODY_ROWS.contains(&&row.stage[..]));
        let untouched = |(i, tool): (usize, &ToolSummary)| {
            (tool.kind == "probe" && tool.contacts_max == 0)
                .then(|| format!("tools[{i}] never touched the body"))
        };
        let tools = self.statistics.tools.iter().enumerate().filter_map(untouched);
        body.chain(plan.flat_map(of_plan)).chain(tools).collect()
    }
}

/// What the solver did in a step.
#[derive(Clone, Debug, Default)]
pub(crate) struct StepOutcome {
    /// Iterations, parts, fallbacks, residual, convergence and times.
    pub report: StepReport,
    /// How often the step or a part of it was cut in two.
    pub halvings: usize,
    /// Steps, 0 or 1, whose equilibrium was found from rest: no way led on from the last one.
    pub from_rest: usize,
    /// The method of the solver that brought each attempt to its tolerance.
    pub converged_by: Vec<&'static str>,
    /// Time of each application of the inverse, ms.
    pub solve_ms: Vec<f64>,
    /// Of the last attempt that did not converge.
    pub missed: Option<Missed>,
}

/// Sums, extremes and times over the steps of a run.
pub(crate) struct RunStatistics {
    begin: Instant,
    /// Before that, in the runs that this one goes on with.
    earlier_s: f64,
    setup_s: f64,
    mesh: MeshSummary,
    worst: Quality,
    steps: StepSummary,
    step_ms: Vec<f64>,
    /// Time of each application of the inverse.
    solve_ms: Vec<f64>,
    estimate: EstimateSummary,
    force: ForceSummary,
    tools: Vec<ToolSummary>,
}

impl RunStatistics {
    /// For a body that is set up, `begin` being when that began.
    pub fn new(begin: Instant, state: &BodyState) -> Self {
        let count = |n| Range { start: n, max: n, end: n };
        let (vertices, tets) = (count(state.vertex_count()), count(state.tet_count()));
        Self {
            begin,
            earlier_s: 0.0,
            setup_s: begin.elapsed().as_secs_f64(),
            mesh: MeshSummary { vertices, tets, ..MeshSummary::default() },
            worst: worst_quality(state),
            steps: StepSummary::default(),
            step_ms: Vec::new(),
            solve_ms: Vec::new(),
            estimate: EstimateSummary::default(),
            force: ForceSummary::default(),
            tools: Vec::new(),
        }
    }

    pub fn steps(&self) -> usize {
        self.steps.count
    }

    fn wall_s(&self) -> f64 {
        self.earlier_s + self.begin.elapsed().as_secs_f64()
    }

    /// All so far.
    pub fn kept(&self) -> KeptStatistics {
        let Self { mesh, worst, steps, step_ms, solve_ms, estimate, force, tools, .. } = self;
        KeptStatistics {
            mesh: *mesh,
            worst: [worst.radius_ratio, worst.circumradius_over_shortest_edge],
            steps: steps.clone(),
            step_ms: step_ms.clone(),
            solve_ms: solve_ms.clone(),
            estimate: *estimate,
            force: *force,
            tools: tools.clone(),
            error_shares: tools.iter().map(|tool| tool.error_share).collect(),
            wall_s: self.wall_s(),
        }
    }

    /// Goes on from what was kept, which does not have all `names`.
    pub fn resume(&mut self, kept: &KeptStatistics, names: &Names<'_>) {
        let KeptStatistics { mesh, steps, step_ms, solve_ms, estimate, force, wall_s, .. } = kept;
        let [radius_ratio, circumradius_over_shortest_edge] = kept.worst;
        self.worst = Quality { radius_ratio, circumradius_over_shortest_edge };
        (self.mesh, self.steps, self.force) = (*mesh, steps.clone(), *force);
        (self.step_ms, self.solve_ms) = (step_ms.clone(), solve_ms.clone());
        self.estimate = names.estimate(*estimate);
        self.tools = names.tools(&kept.tools, &kept.error_shares);
        self.earlier_s += wall_s;
    }

    /// Adds what tools have made of the body in a step that has been added.
    pub fn edit(&mut self, edited: &[Edited]) {
        edited.iter().for_each(|one| self.tools[one.tool].edit(one));
    }

    /// Adds a step, its report filled in, that took `step_ms` in all.
    pub fn add(&mut self, outcome: &StepOutcome, state: &BodyState, step_ms: f64) {
        let report = &outcome.report;
        let Self { mesh, steps, estimate, force, .. } = self;
        steps.count += 1;
        steps.halvings += outcome.halvings;
        steps.from_rest += outcome.from_rest;
        steps.converged += usize::from(report.converged);
        if steps.first_failure.is_none() {
            steps.first_failure.clone_from(&report.failure);
        }
        // A NaN must stay visible: `max` would drop it.
        if !(report.residual <= steps.residual_max) {
            steps.residual_max = report.residual;
        }
        for method in &outcome.converged_by {
            *steps.converged_by.entry((*method).to_owned()).or_default() += 1;
        }
        self.solve_ms.extend_from_slice(&outcome.solve_ms);
        self.step_ms.push(step_ms);
        mesh.splits += report.splits;
        mesh.merges += report.merges;
        mesh.waiting_max = mesh.waiting_max.max(report.waiting);
        mesh.waiting_end = report.waiting;
        for (range, now) in [(&mut mesh.vertices, report.vertices), (&mut mesh.tets, report.tets)] {
            range.max = range.max.max(now);
            range.end = now;
        }
        if let Some(energy) = report.error_estimate {
            estimate.energy_end = Some(energy);
            estimate.energy_max = Some(estimate.energy_max.map_or(energy, |most| most.max(energy)));
        }
        estimate.goal_end = report.goal.or(estimate.goal_end);
        if report.splits > 0 {
            self.worst = self.worst.worse(worst_quality(state));
        }
        force.end_n = report.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        force.max_n = force.max_n.max(force.end_n);
        let unfelt = |kind| ToolSummary { kind, ..ToolSummary::default() };
        let new = report.tools.iter().skip(self.tools.len());
        self.tools.extend(new.map(|tool| unfelt(tool.kind)));
        for (summary, tool) in self.tools.iter_mut().zip(&report.tools) {
            summary.add(tool);
        }
    }
}

fn worst_quality(state: &BodyState) -> Quality {
    let perfect = Quality { radius_ratio: 1.0, circumradius_over_shortest_edge: 0.0 };
    let elements = state.body.elements().iter();
    let qualities = elements.map(|e| Quality::of(&e.vertices.map(|v| state.rest[v])));
    qualities.fold(perfect, Quality::worse)
}
