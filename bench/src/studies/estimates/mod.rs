//! `estimates`: the estimated error of energy over the error itself, on random scenes.
//!
//! `sample.rs` draws a scene: a block of two or three materials, held at a face, under a tool.

mod sample;

use clap::Args;
use serde::Serialize;
use yawara::{Simulation, scene_file};

use self::sample::Sample;
use super::meshes::richardson;
use crate::error::Result;
use crate::harness::arguments::in_range;
use crate::harness::report::markdown::rows as table;
use crate::harness::report::{self, Summary};
use crate::harness::statistics::percentile;
use crate::harness::{Common, Progress};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-estimates-1";

/// Levels from one of the meshes that the limit is taken from to the next: they halve the edges.
const HALVED: usize = 3;

/// What an estimate is good for anything within.
const BOUNDS: [f64; 2] = [0.3, 3.0];

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// Replaces a value of all scenes, as for yawara run; bodies, tools and elements are drawn.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// How many scenes [default: 50, quick: 6].
    #[arg(long, value_name = "N")]
    pub scenes: Option<usize>,
    /// What they are drawn by.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// The level of the finest uniform mesh; nine are voxels, finer ones mean nothing.
    #[arg(long, value_name = "LEVEL", default_value_t = 9)]
    pub finest: usize,
}

/// A scene on a mesh.
#[derive(Clone, Debug, Serialize)]
struct Row {
    /// Number from 0.
    scene: usize,
    /// How its materials lie, how many there are, and the largest ratio of their Young's moduli.
    body: &'static str,
    materials: usize,
    ratio: f64,
    tool: &'static str,
    element: &'static str,
    /// `adaptive`, or the level of a uniform one.
    mesh: String,
    vertices: usize,
    energy_j: f64,
    /// What the energies of uniform meshes go to; where they do not, that of the finest.
    reference_j: f64,
    /// How far the finest one's is from it, relative; absent where they go nowhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    left: Option<f64>,
    /// What the step says of the relative error of its energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    error_estimate: Option<f64>,
    /// |E − E_ref|/E_ref.
    error: f64,
    /// The estimate over the error.
    #[serde(skip_serializing_if = "Option::is_none")]
    effectivity: Option<f64>,
    /// Whether all steps converged, and the mesh no longer changed at the end.
    converged: bool,
}

/// Of the effectivities on one kind of mesh, of all scenes that converged and have a limit.
#[derive(Clone, Debug, Serialize)]
struct Spread {
    mesh: String,
    scenes: usize,
    least: f64,
    quarter: f64,
    median: f64,
    three_quarters: f64,
    most: f64,
    /// How many lie between .3 and 3.
    within: usize,
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { common, set, scenes, seed, finest } = arguments;
    let count = scenes.unwrap_or(if common.quick { 6 } else { 50 });
    in_range("--scenes", count, (1, 10_000))?;
    in_range("--finest", *finest, (2 * HALVED, 9))?;
    let (given, _) = scene_file::load("beam", set)?;
    let folder = common.folder()?;
    let mut progress = Progress::new(count as f64);
    let mut rows = Vec::new();
    for scene in 0..count {
        let sample = Sample::new(&given, seed.wrapping_add(scene as u64))?;
        rows.extend(measured(scene, &sample, *finest as u8)?);
        progress.advance("scene", 1.0);
    }
    report::write(&folder, "estimates", &rows, summary(&rows))
}

/// What a run came to.
struct End {
    vertices: usize,
    energy_j: f64,
    error_estimate: Option<f64>,
    converged: bool,
}

/// A scene on an adaptive mesh and the coarser two of three uniform ones.
fn measured(number: usize, sample: &Sample, finest: u8) -> Result<Vec<Row>> {
    let step = HALVED as u8;
    let levels = [finest - 2 * step, finest - step, finest];
    let mut ends = Vec::new();
    for level in levels {
        ends.push((level.to_string(), end(sample, level, level)?));
    }
    let energies = [0, 1, 2].map(|i| ends[i].1.energy_j);
    let limit = richardson(energies, HALVED).map(|(_, limit)| limit);
    let reference_j = limit.unwrap_or(energies[2]);
    let off = |energy: f64| (energy / reference_j - 1.0).abs();
    let left = limit.map(|_| off(energies[2]));
    let is_solved = ends.iter().all(|(_, end)| end.converged);
    ends[2] = ("adaptive".into(), end(sample, 0, finest)?);
    let row = |(mesh, end): (String, End)| Row {
        scene: number,
        body: sample.body,
        materials: sample.scene.materials.len(),
        ratio: sample.ratio(),
        tool: sample.tool,
        element: sample.element,
        mesh,
        vertices: end.vertices,
        energy_j: end.energy_j,
        reference_j,
        left,
        error_estimate: end.error_estimate,
        error: off(end.energy_j),
        effectivity: end.error_estimate.map(|estimate| estimate / off(end.energy_j)),
        converged: is_solved && end.converged,
    };
    Ok(ends.into_iter().map(row).collect())
}

/// The end of a run between two levels: where the load no longer changes, nor the mesh.
fn end(sample: &Sample, start_level: u8, max_level: u8) -> Result<End> {
    let mut scene = sample.scene.clone();
    (scene.mesh.start_level, scene.mesh.max_level) = (start_level, Some(max_level));
    let refines = scene.mesh.refines();
    scene.time.steps = sample::RAMP * if refines { 6 } else { 1 };
    let mut simulation = Simulation::builder(&scene).volume(sample.volume.clone()).build()?;
    let mut converged = true;
    loop {
        let report = simulation.step()?;
        converged &= report.converged;
        let stays = report.splits + report.merges == 0;
        if simulation.steps_left() == 0 || refines && stays && report.step > sample::RAMP {
            return Ok(End {
                vertices: report.vertices,
                // After splits it would not be that of the equilibrium.
                energy_j: simulation.energy_j(),
                error_estimate: report.error_estimate,
                converged: converged && stays,
            });
        }
    }
}

impl Spread {
    fn new(mesh: &str, rows: &[Row]) -> Self {
        let these =
            rows.iter().filter(|row| row.mesh == mesh && row.converged && row.left.is_some());
        let values: Vec<f64> = these.filter_map(|row| row.effectivity).collect();
        let [least, quarter, median, three_quarters, most] =
            [0.0, 25.0, 50.0, 75.0, 100.0].map(|percent| percentile(&values, percent));
        let within = values.iter().filter(|&&x| BOUNDS[0] < x && x < BOUNDS[1]).count();
        let (mesh, scenes) = (mesh.to_owned(), values.len());
        Self { mesh, scenes, least, quarter, median, three_quarters, most, within }
    }
}

fn summary(rows: &[Row]) -> Summary {
    let mut text = table(
        rows,
        &[
            ("scene", |row| row.scene.to_string()),
            ("body", |row| format!("{} of {}, {:.0}", row.body, row.materials, row.ratio)),
            ("tool", |row| row.tool.to_owned()),
            ("element", |row| row.element.to_owned()),
            ("mesh", |row| row.mesh.clone()),
            ("vertices", |row| row.vertices.to_string()),
            ("energy, J", |row| format!("{:.4e}", row.energy_j)),
            ("finest's error", |row| row.left.map_or_else(String::new, |x| format!("{x:.4}"))),
            ("estimate", |row| row.error_estimate.map_or_else(String::new, |x| format!("{x:.4}"))),
            ("error", |row| format!("{:.4}", row.error)),
            ("effectivity", |row| row.effectivity.map_or_else(String::new, |x| format!("{x:.2}"))),
            ("converged", |row| if row.converged { "yes" } else { "no" }.to_owned()),
        ],
    );
    let spreads: Vec<Spread> = rows[..3].iter().map(|row| Spread::new(&row.mesh, rows)).collect();
    text += &table(
        &spreads,
        &[
            ("effectivity on", |spread| spread.mesh.clone()),
            ("scenes", |spread| spread.scenes.to_string()),
            ("least", |spread| format!("{:.2}", spread.least)),
            ("quarter", |spread| format!("{:.2}", spread.quarter)),
            ("median", |spread| format!("{:.2}", spread.median)),
            ("three quarters", |spread| format!("{:.2}", spread.three_quarters)),
            ("most", |spread| format!("{:.2}", spread.most)),
            ("within .3 and 3", |spread| spread.within.to_string()),
        ],
    );
    Summary::new(text).with("schema", SCHEMA).with("spreads", spreads)
}
