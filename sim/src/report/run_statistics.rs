//! What a run adds up for its summary.

use std::collections::BTreeMap;
use std::time::Instant;

use yawara_mesh::Quality;

use super::records::{
    ForceSummary, InverseSummary, MeshSummary, Percentiles, PlanRow, Range, StepReport,
    StepSummary, Summary, SurfaceSummary,
};
use super::tool::ToolSummary;
use crate::body::{BodyState, BodySummary};
use crate::inverse::InverseLink;
use crate::scene::Scene;

/// Layout version of [`Summary`].
const SCHEMA: u32 = 1;

/// What the solver did in a step besides what its report tells.
#[derive(Clone, Debug, Default)]
pub(crate) struct Work {
    /// How often the step or a part of it was cut in two.
    pub halvings: usize,
    /// The method of the solver that brought each attempt to its tolerance.
    pub converged_by: Vec<&'static str>,
    /// Time of each application of the inverse, ms.
    pub solve_ms: Vec<f64>,
}

/// Sums, extremes and times over the steps of a run.
pub(crate) struct RunStatistics {
    begin: Instant,
    setup_s: f64,
    vertices: Range,
    tets: Range,
    splits: usize,
    merges: usize,
    waiting_max: usize,
    waiting_end: usize,
    worst: Quality,
    steps: usize,
    converged: usize,
    converged_by: BTreeMap<&'static str, usize>,
    /// How often a step or a part of one was cut in two.
    halvings: usize,
    residual_max: f64,
    step_ms: Vec<f64>,
    /// Time of each application of the inverse.
    solve_ms: Vec<f64>,
    force_max: f64,
    force_end: f64,
    tools: Vec<ToolSummary>,
}

impl RunStatistics {
    /// For a body that is set up, `begin` being when that began.
    pub fn new(begin: Instant, state: &BodyState) -> Self {
        let count = |n| Range { start: n, max: n, end: n };
        Self {
            begin,
            setup_s: begin.elapsed().as_secs_f64(),
            vertices: count(state.vertex_count()),
            tets: count(state.tet_count()),
            splits: 0,
            merges: 0,
            waiting_max: 0,
            waiting_end: 0,
            worst: worst_quality(state),
            steps: 0,
            converged: 0,
            converged_by: BTreeMap::new(),
            halvings: 0,
            residual_max: 0.0,
            step_ms: Vec::new(),
            solve_ms: Vec::new(),
            force_max: 0.0,
            force_end: 0.0,
            tools: Vec::new(),
        }
    }

    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Adds a step that took `step_ms` in all.
    pub fn add(&mut self, report: &StepReport, work: &Work, state: &BodyState, step_ms: f64) {
        self.steps += 1;
        self.halvings += work.halvings;
        self.solve_ms.extend_from_slice(&work.solve_ms);
        for method in &work.converged_by {
            *self.converged_by.entry(method).or_default() += 1;
        }
        self.splits += report.splits;
        self.merges += report.merges;
        self.waiting_max = self.waiting_max.max(report.waiting);
        self.waiting_end = report.waiting;
        if report.splits > 0 {
            self.worst = self.worst.worse(worst_quality(state));
        }
        for (range, now) in [(&mut self.vertices, report.vertices), (&mut self.tets, report.tets)] {
            range.max = range.max.max(now);
            range.end = now;
        }
        self.converged += usize::from(report.converged);
        // A NaN must stay visible: `max` would drop it.
        if !(report.residual <= self.residual_max) {
            self.residual_max = report.residual;
        }
        self.step_ms.push(step_ms);
        let force = report.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        self.force_max = self.force_max.max(force);
        self.force_end = force;
        if self.tools.is_empty() {
            self.tools.extend(report.tools.iter().map(|tool| ToolSummary::new(tool.kind)));
        }
        for (summary, tool) in self.tools.iter_mut().zip(&report.tools) {
            summary.add(tool);
        }
    }

    pub fn summary(
        &self,
        scene: &Scene,
        plan: &[PlanRow],
        body: Option<&BodySummary>,
        inverse: &InverseLink,
        surfaces: Vec<SurfaceSummary>,
    ) -> Summary {
        let counts = inverse.maintainer().counts();
        Summary {
            schema: SCHEMA,
            scene: scene.name.clone(),
            seed: scene.seed,
            plan: plan.to_vec(),
            body: body.cloned(),
            mesh: MeshSummary {
                vertices: self.vertices,
                tets: self.tets,
                splits: self.splits,
                merges: self.merges,
                waiting_max: self.waiting_max,
                waiting_end: self.waiting_end,
                worst_radius_ratio: self.worst.radius_ratio,
                worst_circumradius_over_shortest_edge: self.worst.circumradius_over_shortest_edge,
            },
            steps: StepSummary {
                count: self.steps,
                converged: self.converged,
                converged_by: self.converged_by.clone(),
                halvings: self.halvings,
                residual_max: self.residual_max,
                time_ms: Percentiles::of(&self.step_ms),
            },
            inverse: InverseSummary {
                choice: inverse.maintainer().name().into(),
                updates: inverse.updates,
                rebuilds: counts.rebuilds,
                drift_rebuilds: counts.drift_rebuilds,
                failed_pivots: counts.failed_pivots,
                refinement_steps: counts.refinement_steps,
                batches: inverse.batches,
                time_ms: Percentiles::of(&inverse.update_ms),
                solve_ms: Percentiles::of(&self.solve_ms),
                drift_max: inverse.drift_max,
            },
            force: ForceSummary { max_n: self.force_max, end_n: self.force_end },
            motion: None,
            tools: self.tools.clone(),
            surfaces,
            setup_s: self.setup_s,
            wall_s: self.begin.elapsed().as_secs_f64(),
        }
    }
}

fn worst_quality(state: &BodyState) -> Quality {
    let perfect = Quality { radius_ratio: 1.0, circumradius_over_shortest_edge: 0.0 };
    state
        .body
        .elements()
        .iter()
        .map(|element| Quality::of(&element.vertices.map(|v| state.rest[v])))
        .fold(perfect, Quality::worse)
}
