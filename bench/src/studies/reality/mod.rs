//! `reality`: a recorded beam of silicone against its simulation, from one modulus and one ladder of relaxation times
//! that are fitted to the bare beam alone.
//!
//! `recording.rs` reads a marker's height over time, `swing.rs` takes figures from it, `beam.rs` simulates, `ladder.rs`
//! finds the relaxation times.

mod beam;
mod ladder;
mod recording;
mod swing;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use self::beam::{Beam, Damping};
use self::ladder::Ladder;
use self::recording::Recording;
use self::swing::Swing;
use crate::error::{BenchError, Result};
use crate::harness::report::markdown::rows as table;
use crate::harness::report::{self, Summary};
use crate::harness::{Common, Progress};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-reality-1";

/// The recordings that come with the program: `data/silicone_beam/README.md` says whose they are.
const BARE: [&str; 2] = [
    include_str!("../../../data/silicone_beam/beam_bare_a.csv"),
    include_str!("../../../data/silicone_beam/beam_bare_b.csv"),
];
const LOADED: &str = include_str!("../../../data/silicone_beam/beam_510mN.csv");

/// The weight of that recording, N.
const LOAD_N: f64 = 0.510;

/// The longest relaxation time: the length of the recordings after the release, s. The shortest is that of the swing
/// itself, 1/ω: what is faster only damps, and would look like damping by stiffness.
const LONGEST_S: f64 = 4.0;

/// The beam's Poisson ratio, and others for how much it matters.
const POISSON: f64 = 0.499;
const OTHERS: [f64; 3] = [0.45, 0.48, 0.499];

/// What a camera does not tell apart, mm: drops that agree better do so by chance.
const NOISE_MM: f64 = 0.05;

/// How long swings are followed, s.
const SECONDS: f64 = 2.0;

/// Levels of the meshes: edges of 10, 5 and 2.5 mm.
const LEVELS: [u8; 3] = [0, 3, 6];

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// A recording of the same beam with another weight, to be predicted too: a CSV file with the columns time_s and
    /// m1_x_mm, from before the release until rest.
    #[arg(long, value_name = "FILE", requires = "load_n")]
    pub recording: Option<PathBuf>,
    /// The weight that hangs from the tip in that recording, N.
    #[arg(long, value_name = "N", requires = "recording")]
    pub load_n: Option<f64>,
}

/// A figure that was measured and simulated.
#[derive(Clone, Debug, Serialize)]
struct Row {
    load_n: f64,
    /// `fitted` or `predicted`.
    is: &'static str,
    damping: &'static str,
    figure: &'static str,
    measured: f64,
    simulated: f64,
    /// Relative.
    error: f64,
}

/// A drop at rest by mesh and Poisson's ratio, mm.
#[derive(Clone, Debug, Serialize)]
struct Rest {
    load_n: f64,
    poisson_ratio: f64,
    level: u8,
    young_modulus_pa: f64,
    drop_mm: f64,
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { common, recording, load_n } = arguments;
    if let Some(load) = load_n.filter(|load| !(*load > 0.0 && *load <= 10.0)) {
        return Err(BenchError::Load(load));
    }
    let mut loaded = vec![(LOAD_N, swing_of("the loaded beam", LOADED)?)];
    if let (Some(path), Some(load)) = (recording, load_n) {
        let swing = Swing::of(&Recording::read(path)?);
        loaded.push((*load, swing.ok_or_else(|| BenchError::NoSwing(path.display().to_string()))?));
    }
    let folder = common.folder()?;
    let levels = if common.quick { &LEVELS[..1] } else { &LEVELS[..] };
    let level = levels[levels.len() / 2];
    let loads: Vec<f64> =
        std::iter::once(0.0).chain(loaded.iter().map(|(load, _)| *load)).collect();
    let mut progress = Progress::new((2 * loads.len() + levels.len() * loads.len() + 2) as f64);
    let [a, b] = [swing_of("the bare beam", BARE[0])?, swing_of("the bare beam", BARE[1])?];
    let bare = Swing {
        drop_mm: 0.5 * (a.drop_mm + b.drop_mm),
        frequency_hz: 0.5 * (a.frequency_hz + b.frequency_hz),
        damping_ratio: 0.5 * (a.damping_ratio + b.damping_ratio),
    };
    // Of the mean of two.
    let sd_mm = 0.5 * (a.drop_mm - b.drop_mm).abs().max(NOISE_MM);
    let (beam, relative_sd) = fitted(&bare, sd_mm, POISSON, level)?;
    progress.advance("modulus", 1.0);
    let elastic = figures(&beam, &Damping::None)?;
    progress.advance("elastic swing", 1.0);
    let shortest_s = 0.5 / (std::f64::consts::PI * bare.frequency_hz);
    let ladder = Ladder::fit(&bare, elastic.frequency_hz, [shortest_s, LONGEST_S]);
    let beta_s = bare.damping_ratio / (std::f64::consts::PI * bare.frequency_hz);
    let ways = [("prony", Damping::Prony(ladder.clone())), ("rayleigh", Damping::Rayleigh(beta_s))];
    let mut rows = Vec::new();
    for (load_n, measured) in std::iter::once((0.0, bare)).chain(loaded.iter().copied()) {
        for (name, damping) in &ways {
            let simulated = figures(&Beam { load_n, ..beam.clone() }, damping)?;
            progress.advance(name, 1.0);
            let is = if load_n == 0.0 { "fitted" } else { "predicted" };
            rows.extend(compared(load_n, is, name, [&measured, &simulated]));
        }
    }
    let mut rests = Vec::new();
    for &load_n in &loads {
        for &level in levels {
            rests.push(rest(&Beam { load_n, level, ..beam.clone() })?);
            progress.advance("mesh", 1.0);
        }
    }
    for poisson_ratio in OTHERS {
        let (beam, _) = fitted(&bare, sd_mm, poisson_ratio, level)?;
        for &load_n in &loads {
            rests.push(rest(&Beam { load_n, ..beam.clone() })?);
        }
    }
    report::write(
        &folder,
        "reality",
        &rows,
        summary(&rows, &rests, (&beam, relative_sd), &ladder, beta_s),
    )
}

fn swing_of(place: &str, text: &str) -> Result<Swing> {
    Swing::of(&Recording::parse(place, text)?).ok_or_else(|| BenchError::NoSwing(place.into()))
}

/// The bare beam whose marker drops as measured, and the standard deviation of ln E.
fn fitted(bare: &Swing, sd_mm: f64, poisson_ratio: f64, level: u8) -> Result<(Beam, f64)> {
    let beam = Beam { young_modulus_pa: 2.6e5, poisson_ratio, level, load_n: 0.0 };
    beam.fitted(bare.drop_mm, sd_mm)
}

fn rest(beam: &Beam) -> Result<Rest> {
    let &Beam { load_n, poisson_ratio, level, young_modulus_pa } = beam;
    Ok(Rest { load_n, poisson_ratio, level, young_modulus_pa, drop_mm: beam.drop_mm()? })
}

/// A beam's figures: its drop at rest, and its swing about what it comes to.
fn figures(beam: &Beam, damping: &Damping) -> Result<Swing> {
    let rest = -beam.drop_mm()?;
    let swing = Swing::between(&beam.swing(damping, SECONDS)?, 0.0, rest);
    swing.ok_or_else(|| BenchError::NoSwing("the simulated beam".into()))
}

fn compared(load_n: f64, is: &'static str, damping: &'static str, both: [&Swing; 2]) -> [Row; 3] {
    let of = |figure: &'static str, value: fn(&Swing) -> f64| {
        let [measured, simulated] = both.map(value);
        let error = simulated / measured - 1.0;
        Row { load_n, is, damping, figure, measured, simulated, error }
    };
    [
        of("drop_mm", |swing| swing.drop_mm),
        of("frequency_hz", |swing| swing.frequency_hz),
        of("damping_ratio", |swing| swing.damping_ratio),
    ]
}

fn summary(
    rows: &[Row],
    rests: &[Rest],
    (beam, relative_sd): (&Beam, f64),
    ladder: &Ladder,
    beta_s: f64,
) -> Summary {
    let mut text = format!(
        "Bare beam: E = {:.1} kPa after a long time (95 % band {:.1} to {:.1} by how far two recordings differ), {:.1} kPa at once; ladder of {} times from {:.4} to {} s, \
         exponent {:.2}; Rayleigh's β {:.2e} s.\n\n",
        1e-3 * beam.young_modulus_pa,
        1e-3 * beam.young_modulus_pa * (-1.96 * relative_sd).exp(),
        1e-3 * beam.young_modulus_pa * (1.96 * relative_sd).exp(),
        1e-3 * beam.young_modulus_pa * ladder.stiffer,
        ladder.terms.len(),
        ladder.terms[0].time_s,
        LONGEST_S,
        ladder.exponent,
        beta_s,
    );
    text += &table(
        rows,
        &[
            ("load, N", |row| format!("{:.3}", row.load_n)),
            ("", |row| row.is.to_owned()),
            ("damping", |row| row.damping.to_owned()),
            ("figure", |row| row.figure.to_owned()),
            ("measured", |row| format!("{:.4}", row.measured)),
            ("simulated", |row| format!("{:.4}", row.simulated)),
            ("error", |row| format!("{:+.1} %", 100.0 * row.error)),
        ],
    );
    text += "\nDrops at rest by mesh (the first rows, with one modulus) and by Poisson's ratio (with a modulus each):\n\n";
    text += &table(
        rests,
        &[
            ("load, N", |rest| format!("{:.3}", rest.load_n)),
            ("Poisson", |rest| format!("{}", rest.poisson_ratio)),
            ("level", |rest| rest.level.to_string()),
            ("E, kPa", |rest| format!("{:.1}", 1e-3 * rest.young_modulus_pa)),
            ("drop, mm", |rest| format!("{:.3}", rest.drop_mm)),
        ],
    );
    let terms: Vec<[f64; 2]> =
        ladder.terms.iter().map(|term| [term.fraction, term.time_s]).collect();
    Summary::new(text)
        .with("schema", SCHEMA)
        .with("young_modulus_pa", beam.young_modulus_pa)
        .with("relative_sd", relative_sd)
        .with("at_once", ladder.stiffer)
        .with("terms", terms)
        .with("rayleigh_s", beta_s)
        .with("rests", rests)
}
