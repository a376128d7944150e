//! `identify`: moduli from noisy moves of the skin and forces, by how much they are off and how often their bands hold them;
//! the gradient beside differences, and what it costs beside a run.

use std::time::Instant;

use clap::Args;
use nalgebra::Vector3;
use serde::Serialize;
use yawara::identify::{self, Measured, Measurement, Options, misfit, predict};
use yawara::scene::{Image, Scene};
use yawara::scene_file;
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::volume::{Grid, LabelVolume};

use crate::error::Result;
use crate::harness::report::markdown::rows as table;
use crate::harness::report::{self, Summary};
use crate::harness::statistics::{median, milliseconds_since};
use crate::harness::{Common, Progress};
use crate::workloads::random::SplitMix64;

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-identify-1";

/// Standard deviations of the noise: of each component of a move, mm, and of a force, N.
const NOISE: (f64, f64) = (0.1, 0.01);

/// Voxels along the block of four quarters, and their edge, mm.
const BLOCK: (usize, f64) = (16, 5.0);

/// What a block of four quarters is made of, and how its top is pulled.
const QUARTERS: &str = r#"
name = "quarters"
materials = [
    { label = 1, name = "first", young_modulus_pa = 4e3, poisson_ratio = 0.3 },
    { label = 2, name = "second", young_modulus_pa = 9e3, poisson_ratio = 0.3 },
    { label = 3, name = "third", young_modulus_pa = 1.5e4, poisson_ratio = 0.3 },
    { label = 4, name = "fourth", young_modulus_pa = 6e3, poisson_ratio = 0.3 },
]
fixed = [{ shape = "box", min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 0.1] }]
support = { stiffness_n_m4 = 2e10 }
mesh = { base_mm = 40.0, start_level = 3 }
time = { steps = 4, step_s = 0.25 }
[[tools]]
kind = "grab"
region = { shape = "box", min = [0.3, 0.3, 0.9], max = [0.7, 0.7, 1.0] }
path = [{ time_s = 0.0 }, { time_s = 1.0, move_m = [0.008, 0.004, 0.016] }]
"#;

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// Times that noise is drawn anew, for how often bands hold the truth [default: 200; quick: 10].
    #[arg(long, value_name = "N")]
    pub trials: Option<usize>,
}

/// A modulus that was looked for.
#[derive(Clone, Debug, Serialize)]
struct Row {
    body: &'static str,
    points: usize,
    material: String,
    truth_pa: f64,
    start_pa: f64,
    found_pa: f64,
    error: f64,
    relative_sd: f64,
    is_in_band: bool,
}

/// A body with known moduli and what is measured of it.
struct Phantom {
    name: &'static str,
    truth: Scene,
    volume: LabelVolume,
    /// With nothing in place of values.
    asked: Vec<Measurement>,
}

impl Phantom {
    /// Points of the skin, `count` or some more, and the force of the grab, at the times of these steps.
    fn new(
        name: &'static str,
        truth: Scene,
        volume: LabelVolume,
        count: usize,
        steps: &[usize],
    ) -> Self {
        let points = skin(&volume, count);
        let mut asked = Vec::new();
        for step in steps {
            let one = |of, sd| Measurement {
                time_s: *step as f64 * truth.time.step_s,
                of,
                values: [Some(0.0); 3],
                sd: Some(sd),
                place: name.into(),
            };
            asked.extend(points.iter().map(|at| one(Measured::Move((*at).into()), NOISE.0)));
            asked.push(one(Measured::Force(0), NOISE.1));
        }
        Self { name, truth: Scene { image: Image::default(), ..truth }, volume, asked }
    }

    /// Measured after these steps of four.
    fn quarters(points: usize, times: &[usize]) -> Result<Self> {
        let truth = scene_file::parse(QUARTERS, "quarters", &[], true)?;
        let (cells, edge) = BLOCK;
        let label = |i: usize| {
            let (x, y) = (i % cells, i / cells % cells);
            1 + u16::from(2 * x >= cells) + 2 * u16::from(2 * y >= cells)
        };
        let labels = (0..cells.pow(3)).map(label).collect();
        let volume =
            LabelVolume::new(Grid::centred([cells; 3], edge), labels, vec![0, 1, 2, 3, 4])?;
        Ok(Self::new("quarters", truth, volume, points, times))
    }

    /// The liver of the scene, up to where its grab lets go.
    fn liver(points: usize) -> Result<Self> {
        let set = [
            "mesh.start_level=3",
            "mesh.max_vertices=20000",
            "time.steps=12",
            "support.stiffness_n_m4=1.25e11",
        ];
        let (truth, _) = scene_file::load("liver", &set.map(str::to_owned))?;
        let size = LiverPhantom {
            voxel_mm: truth.image.voxel_mm.unwrap_or(2.0),
            length_mm: truth.image.length_mm.unwrap_or(196.0),
            seed: truth.seed,
        };
        Ok(Self::new("liver", truth, liver(size)?, points, &[4, 8, 12]))
    }

    /// What the truth says, with noise.
    fn measured(&self, exact: &[f64], random: &mut SplitMix64) -> Vec<Measurement> {
        let mut measured = self.asked.clone();
        for (one, values) in measured.iter_mut().zip(exact.as_chunks::<3>().0) {
            let sd = one.sd.unwrap_or_default();
            one.values = values.map(|value| Some(value + sd * random.normal()));
        }
        measured
    }

    /// The truth with other moduli of all materials.
    fn with(&self, modulus: impl Fn(usize, f64) -> f64) -> Scene {
        let mut scene = self.truth.clone();
        for (i, material) in scene.materials.iter_mut().enumerate() {
            material.young_modulus_pa = modulus(i, material.young_modulus_pa);
        }
        scene
    }

    /// One search.
    fn found(&self, start: &Scene, measured: &[Measurement]) -> Result<Vec<Row>> {
        let options = Options::default();
        let found =
            identify::identify(start, Some(&self.volume), measured, &options, &mut |_, _| {})?;
        let row = |one: &identify::Modulus| {
            let material = &self.truth.materials[one.entry];
            let truth_pa = material.young_modulus_pa;
            Row {
                body: self.name,
                points: self.asked.iter().filter(|one| matches!(one.of, Measured::Move(_))).count(),
                material: material.name.clone(),
                truth_pa,
                start_pa: one.start_pa,
                found_pa: one.young_modulus_pa,
                error: one.young_modulus_pa / truth_pa - 1.0,
                relative_sd: one.relative_sd,
                is_in_band: (one.band_pa[0]..=one.band_pa[1]).contains(&truth_pa),
            }
        };
        Ok(found.moduli.iter().map(row).collect())
    }
}

/// Middles of voxels of the body beside void or the image's edge, scanner RAS, mm: `count` or some more, evenly among all.
fn skin(volume: &LabelVolume, count: usize) -> Vec<Vector3<f64>> {
    let Grid { dims, spacing_mm, .. } = *volume.grid();
    let is_body = |at: [i64; 3]| {
        let inside = (0..3).all(|axis| (0..dims[axis] as i64).contains(&at[axis]));
        let [x, y, z] = at.map(|at| at as usize);
        inside && volume.get(x, y, z) != 0
    };
    let mut found = Vec::new();
    for i in 0..dims.iter().product() {
        let at = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]].map(|at| at as i64);
        let beside = |axis: usize| {
            [-1, 1].map(|by| {
                let mut next = at;
                next[axis] += by;
                is_body(next)
            })
        };
        if is_body(at) && (0..3).any(|axis| beside(axis).contains(&false)) {
            let local = Vector3::from(at.map(|at| (at as f64 + 0.5) * spacing_mm * 1e-3));
            found.push(volume.grid().to_ras_mm(local));
        }
    }
    let every = (found.len() / count.max(1)).max(1);
    found.into_iter().step_by(every).collect()
}

/// A table that `yawara identify --measured` reads.
fn table_of(measured: &[Measurement]) -> String {
    let mut text =
        String::from("time_s,x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm,sd_mm,tool,fx_n,fy_n,fz_n,sd_n\n");
    for one in measured {
        let numbers = |all: &[f64]| all.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let values = numbers(&one.values.map(Option::unwrap_or_default));
        let (time_s, sd) = (one.time_s, one.sd.unwrap_or_default());
        text += &match one.of {
            Measured::Move(rest) => format!("{time_s},{},{values},{sd},,,,,\n", numbers(&rest)),
            Measured::Force(tool) => format!("{time_s},,,,,,,,{tool},{values},{sd}\n"),
        };
    }
    text
}

/// How far slopes are from those of differences, as a part of the largest, and times of both, ms.
#[derive(Clone, Copy, Debug, Serialize)]
struct Gradient {
    off: f64,
    /// Of a run of the scene alone, and of one with the gradient.
    run_ms: f64,
    with_gradient_ms: f64,
}

fn gradient(phantom: &Phantom, measured: &[Measurement]) -> Result<Gradient> {
    let mut start = phantom.with(|i, modulus| modulus * [1.25, 0.9, 0.8, 1.3][i % 4]);
    start.solver.residual = 1e-12;
    let volume = Some(&phantom.volume);
    let all: Vec<usize> = (0..start.materials.len()).collect();
    let value = |entry: usize, change: f64| {
        let mut scene = start.clone();
        scene.materials[entry].young_modulus_pa *= change.exp();
        Ok::<_, crate::BenchError>(misfit(&scene, volume, measured, &[0])?.0)
    };
    let slopes = misfit(&start, volume, measured, &all)?.1;
    let largest = slopes.iter().fold(0.0, |most: f64, slope| most.max(slope.abs()));
    let mut off: f64 = 0.0;
    for &entry in &all {
        let central =
            |h: f64| Ok::<_, crate::BenchError>((value(entry, h)? - value(entry, -h)?) / (2.0 * h));
        let slope = (4.0 * central(5e-3)? - central(1e-2)?) / 3.0;
        off = off.max((slopes[entry] - slope).abs() / largest);
    }
    let (mut runs, mut with) = (Vec::new(), Vec::new());
    for _ in 0..5 {
        let begin = Instant::now();
        predict(&start, volume, measured)?;
        runs.push(milliseconds_since(begin));
        let begin = Instant::now();
        misfit(&start, volume, measured, &all)?;
        with.push(milliseconds_since(begin));
    }
    Ok(Gradient { off, run_ms: median(&runs), with_gradient_ms: median(&with) })
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { common, trials } = arguments;
    let folder = common.folder()?;
    let trials = trials.unwrap_or(if common.quick { 10 } else { 200 });
    let mut progress = Progress::new(trials as f64 + 20.0);
    let mut random = SplitMix64(1);
    let (mut rows, mut tables) = (Vec::new(), Vec::new());
    let many = if common.quick { 200 } else { 1000 };
    let quarters = Phantom::quarters(many, &[1, 2, 3, 4])?;
    let mut phantoms = vec![quarters];
    if !common.quick {
        phantoms.push(Phantom::liver(many)?);
    }
    for phantom in &phantoms {
        let exact = predict(&phantom.truth, Some(&phantom.volume), &phantom.asked)?;
        let measured = phantom.measured(&exact, &mut random);
        tables.push((format!("{}.csv", phantom.name), table_of(&measured)));
        rows.extend(
            phantom.found(
                &phantom.with(|_, modulus| if modulus > 1e5 { 1e5 } else { 8e3 }),
                &measured,
            )?,
        );
        progress.advance(phantom.name, 8.0);
    }
    let few = Phantom::quarters(60, &[2, 4])?;
    let exact = predict(&few.truth, Some(&few.volume), &few.asked)?;
    let gradient = gradient(&few, &few.measured(&exact, &mut random))?;
    progress.advance("gradient", 4.0);
    let (mut held, mut squares, mut count) = (0, 0.0, 0);
    for _ in 0..trials {
        let measured = few.measured(&exact, &mut random);
        for row in few.found(&few.with(|_, _| 8e3), &measured)? {
            held += usize::from(row.is_in_band);
            squares += ((1.0 + row.error).ln() / row.relative_sd).powi(2);
            count += 1;
        }
        progress.advance("trials", 1.0);
    }
    let coverage = held as f64 / count.max(1) as f64;
    let mut text = table(
        &rows,
        &[
            ("body", |row| row.body.to_owned()),
            ("moves", |row| row.points.to_string()),
            ("material", |row| row.material.clone()),
            ("E, kPa", |row| format!("{:.2}", 1e-3 * row.truth_pa)),
            ("start", |row| format!("{:.2}", 1e-3 * row.start_pa)),
            ("found", |row| format!("{:.3}", 1e-3 * row.found_pa)),
            ("error", |row| format!("{:+.2} %", 1e2 * row.error)),
            ("sd", |row| format!("{:.2} %", 1e2 * row.relative_sd)),
            ("in its band", |row| if row.is_in_band { "yes" } else { "no" }.to_owned()),
        ],
    );
    text += &format!(
        "\n{trials} trials with {} moves each: {held} of {count} bands of 95 % hold the truth ({:.1} %), mean square of error \
         over sd {:.3}.\n\nGradient by one adjoint state a time: {:.1e} of the largest slope off differences; a run of the \
         scene takes {:.1} ms, one with the gradient {:.1} ms ({:.2} times as long).\n",
        few.asked.len() - 2,
        1e2 * coverage,
        squares / count.max(1) as f64,
        gradient.off,
        gradient.run_ms,
        gradient.with_gradient_ms,
        gradient.with_gradient_ms / gradient.run_ms,
    );
    let summary = Summary::new(text);
    let with_tables = tables
        .into_iter()
        .fold(summary, |summary, (name, text)| summary.with_file(name, Some(text)));
    let summary = with_tables
        .with("schema", SCHEMA)
        .with("trials", trials)
        .with("coverage", coverage)
        .with("gradient", gradient);
    report::write(&folder, "identify", &rows, summary)
}
