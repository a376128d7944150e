//! `yawara run`: a scene from its file to its run directory.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::output::{Interrupted, RunDirectory};
use crate::report::{MadeBy, Summary};
use crate::scene::Scene;
use crate::{Checkpoint, SimError, Simulation, scene_file};
use indicatif::{ProgressBar, ProgressStyle};
use yawara_inverse_update::InverseError;

use super::arguments::RunArguments;
use super::console;
use super::printer::Printer;

/// Runs the scene, or goes on with a run; true if every step converged.
pub fn run(arguments: &RunArguments, out: &mut Printer) -> Result<bool, SimError> {
    let (scene, mut directory, checkpoint) = match &arguments.resume {
        Some(path) => {
            let Interrupted { scene, directory, checkpoint } = Interrupted::take(path)?;
            (scene, directory, Some(checkpoint))
        }
        None => {
            let (scene, directory) = begin(arguments)?;
            (scene, directory, None)
        }
    };
    let mut simulation = build(&scene)?;
    out.print(&console::plan(simulation.plan()))?;
    match checkpoint {
        Some(checkpoint) => resume(&mut simulation, &checkpoint, &scene, out)?,
        None => directory.write_scene(&scene, simulation.plan())?,
    }
    let (summary, written) = run_scene(&scene, simulation, directory)?;
    out.print(&console::summary(&summary))?;
    out.print(&format!("written to {}\n", written.display()))?;
    Ok(summary.steps.converged == summary.steps.count)
}

/// The scene as it was asked for, and where its results are to be.
fn begin(arguments: &RunArguments) -> Result<(Scene, RunDirectory), SimError> {
    let mut overrides = arguments.set.clone();
    overrides.extend(arguments.steps.map(|steps| format!("time.steps={steps}")));
    let (scene, _) = scene_file::load(&arguments.scene, &overrides)?;
    if scene.output.field && !cfg!(feature = "nifti") {
        return Err(SimError::FeatureMissing("output.field".into(), "nifti"));
    }
    let target = match &arguments.out {
        Some(path) => path.clone(),
        None => Path::new("runs").join(&scene.name),
    };
    // Before the work, so that a wrong place is known at once.
    let directory = RunDirectory::create(&target, arguments.force)?;
    Ok((scene, directory))
}

fn build(scene: &Scene) -> Result<Simulation, SimError> {
    let bar = bar(PERMILLE, "{msg} {percent} % {wide_bar} {elapsed}");
    let simulation = Simulation::builder(scene)
        .progress(|part, done| {
            bar.set_message(part);
            bar.set_position((done * PERMILLE as f64) as u64);
            ControlFlow::Continue(())
        })
        .build()?;
    bar.finish_and_clear();
    Ok(simulation)
}

fn resume(
    simulation: &mut Simulation,
    checkpoint: &Checkpoint,
    scene: &Scene,
    out: &mut Printer,
) -> Result<(), SimError> {
    simulation.resume(checkpoint)?;
    out.print(&format!("goes on after step {} of {}\n", checkpoint.steps(), scene.time.steps))
}

/// All steps that are left, with all output. If the device that holds the inverse is lost on the way, what was
/// computed until then is written all the same, unless it can be gone on with.
fn run_scene(
    scene: &Scene,
    mut simulation: Simulation,
    mut directory: RunDirectory,
) -> Result<(Summary, PathBuf), SimError> {
    let outcome = run_steps(scene, &mut simulation, &mut directory);
    let is_lost = |error: &SimError| {
        matches!(error, SimError::Inverse(InverseError::Storage { .. }))
            && simulation.steps_left() < scene.time.steps
    };
    if let (Err(_), Some(path)) = (&outcome, directory.resumable()) {
        tracing::warn!("`yawara run --resume {}` goes on from the last checkpoint", path.display());
    }
    let lost = match outcome {
        Ok(()) => {
            if let Some(fields) = simulation.fields()? {
                directory.write_fields(&fields)?;
            }
            None
        }
        Err(error) if is_lost(&error) && directory.resumable().is_none() => Some(error),
        Err(error) => return Err(error),
    };
    let summary = Summary { made_by: Some(MadeBy::this_process()), ..simulation.summary()? };
    directory.write_summary(&summary)?;
    let written = directory.finish()?;
    let Some(error) = lost else { return Ok((summary, written)) };
    let steps = summary.steps.count;
    tracing::warn!("stopped after {steps} steps, kept in {}", written.display());
    Err(error)
}

fn run_steps(
    scene: &Scene,
    simulation: &mut Simulation,
    directory: &mut RunDirectory,
) -> Result<(), SimError> {
    let every = scene.output.frames_every;
    if every > 0 && simulation.steps_left() == scene.time.steps {
        write_frame(scene, simulation, directory, 0)?;
    }
    let bar = bar(simulation.steps_left() as u64, "step {pos}/{len} {wide_bar} {msg} {eta}");
    while simulation.steps_left() > 0 {
        let report = simulation.step()?;
        directory.write_step(&report)?;
        if every > 0 && (report.step % every == 0 || simulation.steps_left() == 0) {
            write_frame(scene, simulation, directory, report.step)?;
        }
        let kept_every = scene.output.checkpoint_steps;
        if kept_every > 0 && report.step % kept_every == 0 && simulation.steps_left() > 0 {
            directory.write_checkpoint(&simulation.checkpoint()?)?;
        }
        bar.set_message(format!("{} vertices", report.vertices));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}

fn write_frame(
    scene: &Scene,
    simulation: &Simulation,
    directory: &mut RunDirectory,
    step: usize,
) -> Result<(), SimError> {
    let whole = simulation.frame()?;
    let frame = if scene.output.void { whole } else { whole.without_void() };
    directory.write_frame(&frame, step)?;
    #[cfg(feature = "gmsh")]
    if scene.output.msh {
        directory.write_msh(&frame, step)?;
    }
    Ok(())
}

/// The length of a bar that shows a fraction.
const PERMILLE: u64 = 1000;

/// A bar on stderr, hidden unless that is a terminal.
fn bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}
