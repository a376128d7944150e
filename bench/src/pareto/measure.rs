//! One run of a scene: its time, its memory, and its errors against the reference.

use std::time::Instant;

use yawara::report::StepReport;
use yawara::scene::Scene;
use yawara::{Probe, SimError, Simulation, Stages};

use super::deadline::Deadline;
use super::path::{Distance, Path};
use crate::error::{BenchError, Result};
use crate::harness::cases::{Advance, Findings};
use crate::harness::machine;
use crate::harness::statistics::{milliseconds_since, percentile};

/// Bytes in a megabyte.
const MEGA: f64 = 1e6;

/// Less growth than this says nothing: what an earlier run gave back may be in use again.
const MEMORY_FLOOR_MB: f64 = 4.0;

/// Runs `scene` with `stages` for at most `cap_s` seconds and compares it with `reference`, if there
/// is one; `watch` sees the simulation after every step, outside of what is timed.
pub(crate) fn measure<'a>(
    scene: &Scene,
    mut stages: Stages,
    reference: Option<&'a Path>,
    cap_s: f64,
    advance: Advance<'_>,
    watch: &mut dyn FnMut(&Simulation) -> Result<()>,
) -> Result<Findings> {
    let before = machine::resident_bytes().filter(|_| machine::reset_peak());
    let begin = Instant::now();
    let deadline = Deadline::after(cap_s);
    stages.inverse = deadline.guard(stages.inverse);
    let steps = scene.time.steps;
    let simulation =
        Simulation::builder(scene).stages(stages).progress(|_, _| deadline.watch()).build();
    let mut simulation = simulation.map_err(|error| ended(error, cap_s, 0, steps))?;
    let precompute_s = begin.elapsed().as_secs_f64();
    let peak = machine::peak_bytes();
    let compare = |path: &'a Path| -> Result<(Probe, Distance<'a>)> {
        let probe = simulation.probe(path.level)?;
        let distance = Distance::from(path, &probe)?;
        Ok((probe, distance))
    };
    let mut compared = reference.map(compare).transpose()?;
    // The probe is the study's, not the run's.
    let probed = machine::resident_bytes().filter(|_| machine::reset_peak());
    let (mut iterations, mut fallbacks, mut step_ms) = (0, 0, Vec::new());
    run_steps(&mut simulation, cap_s, |simulation, report, ms| {
        if let Some((probe, distance)) = &mut compared {
            let x = simulation.probe_positions(probe)?;
            distance.add(probe, &x, report.force_n);
        }
        iterations += report.iterations;
        fallbacks += report.fallbacks;
        step_ms.push(ms);
        advance(report.step as f64 / steps as f64);
        watch(simulation)
    })?;
    let summary = simulation.summary()?;
    let grown = |from: Option<u64>, to: Option<u64>| Some(to?.saturating_sub(from?) as f64 / MEGA);
    let start_mb = grown(before, peak);
    let more_mb = grown(probed, machine::peak_bytes());
    let mut found = Findings::default();
    let figures = &mut found.figures;
    if let Some((_, distance)) = &compared {
        let [displacement, force, volume] = distance.errors();
        figures.put("error_displacement", displacement);
        figures.put("error_force", force);
        figures.put("error_volume", volume);
    }
    figures.put("steps", summary.steps.count);
    figures.put("converged", summary.steps.converged);
    figures.put("residual_max", summary.steps.residual_max);
    figures.put("iterations", iterations);
    figures.put("fallbacks", fallbacks);
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
    let all_ms: f64 = step_ms.iter().sum();
    measured.put("step_mean_ms", all_ms / step_ms.len().max(1) as f64);
    measured.put("step_p50_ms", percentile(&step_ms, 50.0));
    measured.put("step_p99_ms", percentile(&step_ms, 99.0));
    measured.put("update_p50_ms", summary.inverse.time_ms.p50);
    measured.put("precompute_s", precompute_s);
    let memory_mb = start_mb.zip(more_mb).map(|(start, more)| start + more);
    measured.put("memory_mb", memory_mb.filter(|megabytes| *megabytes >= MEMORY_FLOOR_MB));
    measured.put("total_s", begin.elapsed().as_secs_f64());
    Ok(found)
}

/// What the plan has for a stage.
pub(crate) fn choice(simulation: &Simulation, stage: &str) -> String {
    let row = simulation.plan().iter().find(|row| row.stage == stage);
    row.map_or_else(String::new, |row| row.choice.clone())
}

/// What an error in a step says: that the time was up, or itself.
pub(crate) fn ended(error: SimError, cap_s: f64, step: usize, steps: usize) -> BenchError {
    if Deadline::ended(&error) { BenchError::TimeIsUp(cap_s, step, steps) } else { error.into() }
}

/// Makes all steps; `visit` sees each with its time in ms, outside of what is timed.
pub(crate) fn run_steps(
    simulation: &mut Simulation,
    cap_s: f64,
    mut visit: impl FnMut(&Simulation, &StepReport, f64) -> Result<()>,
) -> Result<()> {
    let begin = Instant::now();
    let steps = simulation.steps_left();
    while simulation.steps_left() > 0 {
        let step = steps - simulation.steps_left() + 1;
        if begin.elapsed().as_secs_f64() > cap_s {
            return Err(BenchError::TimeIsUp(cap_s, step, steps));
        }
        let start = Instant::now();
        let report = simulation.step();
        let ms = milliseconds_since(start);
        let report = report.map_err(|error| ended(error, cap_s, step, steps))?;
        visit(simulation, &report, ms)?;
    }
    Ok(())
}
