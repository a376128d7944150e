//! One run of a scene: its time, its memory, and its errors against the reference.

use std::time::Instant;

use yawara::report::StepReport;
use yawara::scene::Scene;
use yawara::{Probe, Simulation, Stages};

use super::deadline::Deadline;
use super::path::{Distance, Path};
use crate::error::BenchError;
use crate::harness::cases::{Advance, Findings};
use crate::harness::machine;
use crate::harness::statistics::percentile;

/// Bytes in a megabyte.
const MEGA: f64 = 1e6;

/// Less growth than this says nothing: what an earlier run gave back may be in use again.
const MEMORY_FLOOR_MB: f64 = 4.0;

/// Runs `scene` with `stages` for at most `cap_s` seconds and compares it with `reference`, if there
/// is one; `watch` sees the simulation after every step, outside of what is timed.
///
/// # Errors
/// [`BenchError::TimeIsUp`]; [`BenchError::OtherPoints`]; what the simulation refuses.
pub fn measure(
    scene: &Scene,
    mut stages: Stages,
    reference: Option<&Path>,
    cap_s: f64,
    advance: Advance<'_>,
    watch: &mut dyn FnMut(&Simulation) -> Result<(), BenchError>,
) -> Result<Findings, BenchError> {
    let before = machine::resident_bytes().filter(|_| machine::reset_peak());
    let begin = Instant::now();
    let deadline = Deadline::after(cap_s);
    stages.inverse = deadline.guard(stages.inverse);
    let steps = scene.time.steps;
    let ended = |error: yawara::SimError, step: usize| match Deadline::ended(&error) {
        true => BenchError::TimeIsUp { seconds: cap_s, step, steps },
        false => error.into(),
    };
    let simulation =
        Simulation::builder(scene).stages(stages).progress(|_| deadline.watch()).build();
    let mut simulation = simulation.map_err(|error| ended(error, 0))?;
    let precompute_s = begin.elapsed().as_secs_f64();
    let peak = machine::peak_bytes();
    let mut compared = reference.map(|path| Compared::new(path, &simulation)).transpose()?;
    // The probe is the study's, not the run's.
    let probed = machine::resident_bytes().filter(|_| machine::reset_peak());
    let mut totals = Totals::default();
    run_steps(&mut simulation, cap_s, |simulation, report, ms| {
        if let Some(Compared { probe, distance }) = &mut compared {
            let x = simulation.probe_positions(probe)?;
            distance.add(probe, &x, report.force_n);
        }
        totals.add(report, ms);
        advance(report.step as f64 / steps as f64);
        watch(simulation)
    })?;
    let summary = simulation.summary()?;
    let grown = |from: Option<u64>, to: Option<u64>| Some(to?.saturating_sub(from?) as f64 / MEGA);
    let start_mb = grown(before, peak);
    let more_mb = grown(probed, machine::peak_bytes());
    let mut found = Findings::default();
    let figures = &mut found.figures;
    if let Some(Compared { distance, .. }) = &compared {
        figures.put("error_displacement", distance.displacement());
        figures.put("error_force", distance.force());
        figures.put("error_volume", distance.volume());
    }
    figures.put("steps", summary.steps.count);
    figures.put("converged", summary.steps.converged);
    figures.put("residual_max", summary.steps.residual_max);
    figures.put("iterations", totals.iterations);
    figures.put("fallbacks", totals.fallbacks);
    figures.put("halvings", summary.steps.halvings);
    figures.put("vertices_max", summary.mesh.vertices.max);
    figures.put("vertices_end", summary.mesh.vertices.end);
    figures.put("updates", summary.inverse.updates);
    figures.put("rebuilds", summary.inverse.rebuilds);
    figures.put("failed_pivots", summary.inverse.failed_pivots);
    figures.put("drift_max", summary.inverse.drift_max);
    figures.put("element", choice(&simulation, "element"));
    figures.put("inverse", summary.inverse.choice);
    let measured = &mut found.measured;
    let all_ms: f64 = totals.step_ms.iter().sum();
    measured.put("step_mean_ms", all_ms / totals.step_ms.len().max(1) as f64);
    measured.put("step_p50_ms", percentile(&totals.step_ms, 50.0));
    measured.put("step_p99_ms", percentile(&totals.step_ms, 99.0));
    measured.put("update_p50_ms", summary.inverse.time_ms.p50);
    measured.put("precompute_s", precompute_s);
    let memory_mb = start_mb.zip(more_mb).map(|(start, more)| start + more);
    measured.put("memory_mb", memory_mb.filter(|megabytes| *megabytes >= MEMORY_FLOOR_MB));
    measured.put("total_s", begin.elapsed().as_secs_f64());
    Ok(found)
}

fn choice(simulation: &Simulation, stage: &str) -> String {
    let row = simulation.plan().iter().find(|row| row.stage == stage);
    row.map_or_else(String::new, |row| row.choice.clone())
}

/// A run beside the reference: the points that both have, and how far apart they are.
struct Compared<'a> {
    probe: Probe,
    distance: Distance<'a>,
}

impl<'a> Compared<'a> {
    fn new(path: &'a Path, simulation: &Simulation) -> Result<Self, BenchError> {
        let probe = simulation.probe(path.level)?;
        Ok(Self { distance: Distance::from(path, &probe)?, probe })
    }
}

#[derive(Default)]
struct Totals {
    iterations: usize,
    fallbacks: usize,
    step_ms: Vec<f64>,
}

impl Totals {
    fn add(&mut self, report: &StepReport, ms: f64) {
        self.iterations += report.iterations;
        self.fallbacks += report.fallbacks;
        self.step_ms.push(ms);
    }
}

/// Makes all steps; `visit` sees each with its time in ms, outside of what is timed.
///
/// # Errors
/// [`BenchError::TimeIsUp`] once the steps have taken more than `cap_s` seconds.
pub(crate) fn run_steps(
    simulation: &mut Simulation,
    cap_s: f64,
    mut visit: impl FnMut(&Simulation, &StepReport, f64) -> Result<(), BenchError>,
) -> Result<(), BenchError> {
    let begin = Instant::now();
    let steps = simulation.steps_left();
    while simulation.steps_left() > 0 {
        let step = steps - simulation.steps_left() + 1;
        let ended = BenchError::TimeIsUp { seconds: cap_s, step, steps };
        if begin.elapsed().as_secs_f64() > cap_s {
            return Err(ended);
        }
        let start = Instant::now();
        let report = simulation.step();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let report = report.map_err(|error| match Deadline::ended(&error) {
            true => ended,
            false => error.into(),
        })?;
        visit(simulation, &report, ms)?;
    }
    Ok(())
}
