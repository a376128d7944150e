//! `touch`: the rate and the force of `palpate` as it is, beside evenly laid meshes, and what a change of the mesh does
//! to the force.

use std::mem::replace;
use std::time::Instant;

use clap::Args;
use nalgebra::Vector3;
use serde::Serialize;
use yawara::report::StepReport;
use yawara::scene::Scene;
use yawara::{Checkpoint, Simulation, scene_file};

use crate::error::Result;
use crate::harness::arguments::in_range;
use crate::harness::report::markdown::rows as table;
use crate::harness::report::{self, Summary};
use crate::harness::statistics::{milliseconds_since, percentile};
use crate::harness::{Common, Progress};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-touch-1";

/// The reference is solved in each of so many steps only.
const REFERENCE_EVERY: usize = 10;

/// Fine under the ball throughout, with more points to touch.
const REFERENCE: [&str; 7] = [
    "mesh.start_level=3",
    "mesh.max_vertices=90000",
    "refinement.ease_s=0",
    "refinement.split_above=1",
    "refinement.every_steps=1",
    "refinement.max_splits_per_step=1000000",
    "tools.0.spacing_m=0.001",
];

/// Levels of evenly laid meshes, of voxels of 16 mm cut up.
const LEVELS: (usize, usize) = (2, 6);

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// Replaces a value of the scene for all, as for yawara run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// The finest evenly laid mesh, from 2 to 6 [default: 4, quick: 2].
    #[arg(long, value_name = "LEVEL")]
    pub finest: Option<usize>,
}

/// The scene on a mesh.
#[derive(Clone, Debug, Serialize)]
struct Row {
    mesh: String,
    /// At most.
    vertices: usize,
    converged: usize,
    steps: usize,
    mean_ms: f64,
    p50_ms: f64,
    p99_ms: f64,
    worst_ms: f64,
    /// Root mean square over the steps of the reference, over its largest force.
    force_error: f64,
    /// The largest of them.
    worst_force_error: f64,
}

/// What changes of the mesh do to the force in the step after them.
#[derive(Clone, Debug, Default, Serialize)]
struct Jumps {
    /// Steps that changed the mesh.
    changes: usize,
    /// The largest and the mean difference to the force of the same step on the mesh that was, as vectors, over the
    /// largest force of the reference.
    largest: f64,
    mean: f64,
    /// The step with the largest one.
    step: usize,
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { common, set, finest } = arguments;
    let finest = finest.unwrap_or(if common.quick { LEVELS.0 } else { 4 });
    in_range("--finest", finest, LEVELS)?;
    let quick = if common.quick { &["time.steps=60"][..] } else { &[] };
    let scene = |keys: &[String]| -> Result<Scene> {
        let quick = quick.iter().map(ToString::to_string);
        let all: Vec<String> =
            ["output.frames_every=0".into()].into_iter().chain(quick).chain(set.clone()).collect();
        Ok(scene_file::load("palpate", &[&all[..], keys].concat())?.0)
    };
    let [is, still] =
        [scene(&kept_keys(&[]))?, scene(&kept_keys(&["refinement.max_splits_per_step=0"]))?];
    let (level, within) = if common.quick { (9, "0.008") } else { (12, "0.012") };
    let near = [
        format!("mesh.max_level={level}"),
        format!("refinement.near_probe={{level={level},within_m={within}}}"),
    ];
    in_range("time.steps", is.time.steps, (REFERENCE_EVERY, 100_000))?;
    let mut reference = scene(&[&REFERENCE.map(String::from)[..], &near].concat())?;
    reference.time.steps = is.time.steps / REFERENCE_EVERY;
    reference.time.step_s *= REFERENCE_EVERY as f64;
    let folder = common.folder()?;
    let mut progress = Progress::new((finest - LEVELS.0 + 4) as f64);

    let forces = forces(&course(&reference)?.0);
    progress.advance("reference", 1.0);
    let mut rows = Vec::new();
    let adaptive = course(&scene(&[])?)?;
    rows.push(Row::new("as it is", &adaptive, &forces));
    progress.advance("as it is", 1.0);
    for level in LEVELS.0..=finest {
        let keys = [
            "mesh.base_mm=16".to_owned(),
            format!("mesh.start_level={level}"),
            format!("mesh.max_level={level}"),
            "mesh.max_vertices=90000".into(),
            format!("refinement.near_probe={{level={level},within_m=0.002}}"),
        ];
        rows.push(Row::new(&format!("even level {level}"), &course(&scene(&keys)?)?, &forces));
        progress.advance("even", 1.0);
    }
    let jumps = jumps(&is, &still, largest(&forces))?;
    progress.advance("changes", 1.0);
    report::write(&folder, "touch", &rows, summary(&rows, jumps, largest(&forces)))
}

/// For a simulation that is kept and gone on with at each step.
fn kept_keys(keys: &[&str]) -> Vec<String> {
    keys.iter().chain(&["output.checkpoint_steps=1"]).map(ToString::to_string).collect()
}

/// All steps, and what each of them took, ms.
fn course(scene: &Scene) -> Result<(Vec<StepReport>, Vec<f64>)> {
    let mut simulation = Simulation::builder(scene).build()?;
    let (mut steps, mut times) = (Vec::new(), Vec::new());
    while simulation.steps_left() > 0 {
        let begin = Instant::now();
        steps.push(simulation.step()?);
        times.push(milliseconds_since(begin));
    }
    Ok((steps, times))
}

/// On the ball, N.
fn forces(steps: &[StepReport]) -> Vec<Vector3<f64>> {
    steps.iter().map(|step| step.force_n.into()).collect()
}

fn largest(forces: &[Vector3<f64>]) -> f64 {
    forces.iter().map(Vector3::norm).fold(0.0, f64::max)
}

/// Every step that changes the mesh, followed by one; and the same two from where they began, without the change.
fn jumps(is: &Scene, still: &Scene, scale: f64) -> Result<Jumps> {
    let mut is = Simulation::builder(is).build()?;
    let mut still = Simulation::builder(still).build()?;
    let (mut jumps, mut sum) = (Jumps::default(), 0.0);
    let mut here = is.checkpoint()?;
    let mut unchanged: Option<Checkpoint> = None;
    while is.steps_left() > 0 {
        let report = is.step()?;
        if let Some(before) = unchanged.take() {
            still.resume(&before)?;
            still.step()?;
            let other = still.step()?;
            let jump =
                (Vector3::from(report.force_n) - Vector3::from(other.force_n)).norm() / scale;
            jumps.changes += 1;
            sum += jump;
            if jump > jumps.largest {
                (jumps.largest, jumps.step) = (jump, report.step - 1);
            }
        }
        let before = replace(&mut here, is.checkpoint()?);
        unchanged = (report.splits + report.merges > 0).then_some(before);
    }
    jumps.mean = sum / jumps.changes.max(1) as f64;
    Ok(jumps)
}

impl Row {
    fn new(
        mesh: &str,
        (steps, times): &(Vec<StepReport>, Vec<f64>),
        reference: &[Vector3<f64>],
    ) -> Self {
        let forces = forces(steps);
        let same = forces.iter().skip(REFERENCE_EVERY - 1).step_by(REFERENCE_EVERY);
        let off: Vec<f64> =
            same.zip(reference).map(|(force, want)| (force - want).norm()).collect();
        let squares: f64 = off.iter().map(|off| off * off).sum();
        let scale = largest(reference);
        Self {
            mesh: mesh.to_owned(),
            vertices: steps.iter().map(|step| step.vertices).max().unwrap_or(0),
            converged: steps.iter().filter(|step| step.converged).count(),
            steps: steps.len(),
            mean_ms: times.iter().sum::<f64>() / times.len() as f64,
            p50_ms: percentile(times, 50.0),
            p99_ms: percentile(times, 99.0),
            worst_ms: percentile(times, 100.0),
            force_error: (squares / off.len() as f64).sqrt() / scale,
            worst_force_error: off.iter().copied().fold(0.0, f64::max) / scale,
        }
    }
}

fn summary(rows: &[Row], jumps: Jumps, largest_n: f64) -> Summary {
    let mut text = table(
        rows,
        &[
            ("mesh", |row| row.mesh.clone()),
            ("vertices", |row| row.vertices.to_string()),
            ("converged", |row| format!("{} of {}", row.converged, row.steps)),
            ("force's error", |row| format!("{:.3}", row.force_error)),
            ("worst", |row| format!("{:.3}", row.worst_force_error)),
            ("mean, ms", |row| format!("{:.2}", row.mean_ms)),
            ("p50", |row| format!("{:.2}", row.p50_ms)),
            ("p99", |row| format!("{:.1}", row.p99_ms)),
            ("steps/s, p50", |row| format!("{:.0}", 1e3 / row.p50_ms)),
            ("p99", |row| format!("{:.0}", 1e3 / row.p99_ms)),
        ],
    );
    let is = &rows[0];
    for row in &rows[1..] {
        text += &format!(
            "{}: {:.1} x the time of a step, {:.2} x the error\n",
            row.mesh,
            row.mean_ms / is.mean_ms,
            row.force_error / is.force_error
        );
    }
    text += &format!(
        "{} steps changed the mesh. In the step after one the force differs from that without the change by {:.4} of \
         the largest ({largest_n:.3} N) at most (step {}), {:.4} on average.\n",
        jumps.changes, jumps.largest, jumps.step, jumps.mean
    );
    Summary::new(text)
        .with("schema", SCHEMA)
        .with("largest_force_n", largest_n)
        .with("jumps", jumps)
}
