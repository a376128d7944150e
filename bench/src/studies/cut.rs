//! `cut`: what it takes to double a vertex, beside a split and a factor made anew.

use std::time::Instant;

use serde::Serialize;
use yawara_inverse_update::{InverseMaintainer, build};

use crate::bodies::organ::Organ;
use crate::error::Result;
use crate::harness::report::markdown::table;
use crate::harness::report::{self, Summary, spread};
use crate::harness::statistics::{median, milliseconds_since};
use crate::harness::{Common, Machine, Progress};
use crate::solvers::in_one_thread;
use crate::workloads::{History, SplitMix64, Update};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-cut-1";

/// Free vertices, and how often each thing is done.
const SIZES: [usize; 4] = [512, 1024, 2048, 3456];
const ROUNDS: usize = 40;
const QUICK_SIZES: [usize; 1] = [192];
const QUICK_ROUNDS: usize = 6;

/// Maintainers, and the largest size at which a dense one takes part.
const MAINTAINERS: [&str; 2] = ["sparse", "woodbury"];
const MOST_DENSE: usize = 2048;

/// Factors made anew at each size.
const FACTORS: usize = 3;

const SEED: u64 = 16;

/// Medians of one maintainer at one size, ms.
#[derive(Clone, Debug, Serialize)]
struct Row {
    maintainer: &'static str,
    vertices: usize,
    split_ms: f64,
    merge_ms: f64,
    /// A vertex that some of its tetrahedra leave for a twin.
    double_ms: f64,
    /// The same taken back.
    join_ms: f64,
    /// Of the first in a round, after a split and its merge.
    double_over_split: f64,
    factor_ms: f64,
    factor_over_double: f64,
    /// ‖S(u − u*)‖ / ‖S u*‖ of a solution with all of the last round's vertices doubled, u* by a factor made anew,
    /// S = (diag K)^½.
    error: f64,
}

/// A column of the table.
type Figure = fn(&Row) -> f64;

const FIGURES: [(&str, Figure); 5] = [
    ("split, ms", |row| row.split_ms),
    ("double, ms", |row| row.double_ms),
    ("double over split", |row| row.double_over_split),
    ("factor over double", |row| row.factor_over_double),
    ("error", |row| row.error),
];

/// Runs the study.
///
/// # Errors
/// Those of the folder, of the organ and of maintainers.
pub fn run(arguments: &Common) -> Result<String> {
    let folder = arguments.folder()?;
    let rows = in_one_thread(|| measure(arguments.quick))?;
    let machine = Machine::here();
    let summary = Summary::new(text(&rows, &machine));
    let summary = summary.with("schema", SCHEMA).with("seed", SEED).with("machine", machine);
    report::write(&folder, "cut", &rows, summary)
}

fn text(rows: &[Row], machine: &Machine) -> String {
    let mut text = format!("# cut\n\n{}, one thread; medians.\n\n", machine.cpu);
    let heads: Vec<String> = FIGURES.map(|(name, _)| name.to_owned()).into();
    let cells = rows.iter().flat_map(|row| FIGURES.map(|figure| (row, figure)));
    let cells: Vec<_> = cells.collect();
    let place = |(row, (name, _)): &(&Row, (&str, Figure))| {
        (format!("{}, {} vertices", row.maintainer, row.vertices), (*name).to_owned())
    };
    let value = |(row, (_, figure)): &(&Row, (&str, Figure))| {
        let x = figure(row);
        if x < 1e-3 { format!("{x:.1e}") } else { format!("{x:.3}") }
    };
    text += &table("", &heads, &spread(&heads, cells, place, value));
    text
}

fn measure(quick: bool) -> Result<Vec<Row>> {
    let (sizes, rounds) = match quick {
        true => (&QUICK_SIZES[..], QUICK_ROUNDS),
        false => (&SIZES[..], ROUNDS),
    };
    let mut progress = Progress::new((sizes.len() * MAINTAINERS.len()) as f64);
    let mut rows = Vec::new();
    for &vertices in sizes {
        for maintainer in MAINTAINERS {
            if maintainer == "sparse" || vertices <= MOST_DENSE {
                rows.push(row(maintainer, vertices, rounds)?);
            }
            progress.advance(&format!("{maintainer}, {vertices}"), 1.0);
        }
    }
    Ok(rows)
}

fn row(name: &'static str, vertices: usize, rounds: usize) -> Result<Row> {
    let organ = Organ::with_at_most(vertices)?;
    let mut history = History::refined(&organ, "laminate", vertices, 0, SEED)?;
    let stiffness = history.stiffness()?;
    let mut maintainer = build(name, stiffness)?;
    let mut times: [Vec<f64>; 4] = Default::default();
    let timed = |update: &Update, maintainer: &mut dyn InverseMaintainer| {
        let begin = Instant::now();
        update.apply(maintainer)?;
        Ok::<_, crate::error::BenchError>(milliseconds_since(begin))
    };
    // Turn by turn, so that a busy machine is busy for all of them.
    for _ in 0..rounds {
        let changes = [history.split_and_merge()?, history.double_and_join()?];
        for (update, times) in changes.iter().flatten().zip(&mut times) {
            times.push(timed(update, maintainer.as_mut())?);
        }
    }
    let ratios: Vec<f64> = times[2].iter().zip(&times[0]).map(|(a, b)| a / b).collect();
    let [double, _] = history.double_and_join()?;
    double.apply(maintainer.as_mut())?;
    let mut factor_ms = Vec::new();
    let mut fresh = None;
    for _ in 0..FACTORS {
        let k = maintainer.stiffness().clone();
        let begin = Instant::now();
        fresh = Some(build(name, k)?);
        factor_ms.push(milliseconds_since(begin));
    }
    let error = fresh.map_or(Ok(f64::NAN), |fresh| error(maintainer.as_ref(), fresh.as_ref()))?;
    let [split_ms, merge_ms, double_ms, join_ms] = times.each_ref().map(|times| median(times));
    let factor_ms = median(&factor_ms);
    Ok(Row {
        maintainer: name,
        vertices,
        split_ms,
        merge_ms,
        double_ms,
        join_ms,
        double_over_split: median(&ratios),
        factor_ms,
        factor_over_double: factor_ms / double_ms,
        error,
    })
}

/// Of a solution by one maintainer against that of another of the same K.
fn error(kept: &dyn InverseMaintainer, fresh: &dyn InverseMaintainer) -> Result<f64> {
    let k = fresh.stiffness();
    let n = k.dofs();
    let mut random = SplitMix64(SEED);
    let scale: Vec<f64> = (0..n).map(|i| k.diagonal(i).sqrt()).collect();
    let load: Vec<f64> = scale.iter().map(|s| s * random.symmetric()).collect();
    let [mut found, mut want] = [vec![0.0; n], vec![0.0; n]];
    kept.solve(&load, &mut found)?;
    fresh.solve(&load, &mut want)?;
    let norm = |of: &dyn Fn(usize) -> f64| (0..n).map(|i| (scale[i] * of(i)).powi(2)).sum::<f64>();
    Ok((norm(&|i| found[i] - want[i]) / norm(&|i| want[i])).sqrt())
}
