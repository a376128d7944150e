//! Why a step found no equilibrium, where, and what may help.

use std::fmt;

use nalgebra::Vector3;

use super::records::{Failure, StepReport};
use crate::body::ScannerAxes;
use crate::scene::Scene;

/// A residual that is above its limit by less than this factor may be small enough for its scene.
const NEARLY: f64 = 100.0;

/// Where an attempt that did not converge is farthest from balance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Missed {
    /// Solver axes, at rest, m.
    pub place: Vector3<f64>,
    /// The largest label around it.
    pub label: i64,
    /// What is left, N.
    pub force_n: f64,
    /// Tetrahedra that are turned inside out or folded flat.
    pub folded: usize,
    /// Whether the law is `linear`.
    pub is_linear: bool,
}

impl Failure {
    /// Of a step in this scene through which the body was followed up to `reached_s`.
    pub(crate) fn new(
        report: &StepReport,
        missed: &Missed,
        reached_s: f64,
        scene: &Scene,
        axes: ScannerAxes,
    ) -> Self {
        Self {
            step: report.step,
            time_s: report.time_s,
            reached_s,
            residual: report.residual,
            limit: scene.solver.residual,
            iterations: report.iterations,
            place_mm: axes.to_ras_mm(&missed.place).into(),
            label: missed.label,
            force_n: missed.force_n,
            folded: missed.folded,
            advice: advice(report, missed, scene),
        }
    }
}

/// What to try, most likely first.
fn advice(report: &StepReport, missed: &Missed, scene: &Scene) -> Vec<String> {
    let Scene { time, solver, .. } = scene;
    let folded = missed.folded;
    let is_used_up = report.iterations >= solver.step_iterations;
    let is_linear = missed.is_linear && scene.stages.corotation == "element";
    let (steps, step_s) = (2 * time.steps, 0.5 * time.step_s);
    let (iterations, residual) = (4 * solver.step_iterations, 2.0 * report.residual);
    let all = [
        (!time.adaptive, "time.adaptive = true, to make a step in parts".into()),
        (
            scene.stages.equilibrium != "fallback",
            "stages.equilibrium = \"fallback\", which tries all methods in turn".into(),
        ),
        (
            folded > 0 && is_linear && scene.dynamics.is_none(),
            format!(
                "stages.law = \"neo_hookean\": {folded} tetrahedra are folded or inside out, where \
                 the linear law ends"
            ),
        ),
        (
            is_used_up,
            format!("solver.step_iterations = {iterations}: the step has used up its iterations"),
        ),
        (is_used_up, format!("time.steps = {steps} with time.step_s = {step_s}: less at once")),
        (
            report.residual < NEARLY * solver.residual,
            format!("solver.residual = {residual:.0e}, if that is exact enough"),
        ),
        (
            scene.dynamics.is_none(),
            "[dynamics]: a load beyond what the body can bear at rest sets it in motion".into(),
        ),
    ];
    all.into_iter().filter(|(applies, _)| *applies).map(|(_, words)| words).collect()
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { step, time_s, reached_s, residual, limit, iterations, .. } = self;
        let [x, y, z] = self.place_mm;
        write!(
            f,
            "step {step} (to {time_s:.4} s) came to {reached_s:.4} s: relative residual \
             {residual:.1e}, want {limit:.1e}, after {iterations} iterations; worst at \
             ({x:.1}, {y:.1}, {z:.1}) mm in label {} with {:.2e} N",
            self.label, self.force_n
        )
    }
}
