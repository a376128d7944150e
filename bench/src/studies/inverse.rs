//! `inverse`: what a split, a merge and a solve cost under each maintainer, and what they lose.
//!
//! All competitors are given the same random history. Within one update they take turns and the
//! first one changes from update to update, so that all meet the same clock and the same caches;
//! after each of them comes one pass over as many bytes as it holds, its memory bound.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use faer::Mat;
use yawara_inverse_update::{InverseMaintainer, Lu, SparseStiffness, build, drift};
use yawara_mesh::Change;

use crate::accuracy::inverse_error;
use crate::error::BenchError;
use crate::history::{History, Update};
use crate::organ::{Organ, Size};
use crate::output::Output;
use crate::random::SplitMix64;
use crate::statistics::{median, percentile, ratios};
use crate::stream::Stream;
use crate::studies::inverse_report::{LuRow, Report, Row, SCHEMA, Times};

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// Where inverse.csv, inverse.json and inverse.txt go: a new or empty directory.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// A body of about 150 vertices instead of 736.
    #[arg(long)]
    pub quick: bool,
    /// Splits and merges, all together.
    #[arg(long, value_name = "N", default_value_t = 400)]
    pub updates: usize,
    /// Picks the rings and the loads.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Write into a directory that is not empty.
    #[arg(long)]
    pub force: bool,
}

/// A competitor: its scene name, and whether it stores half of the symmetric C or all of it.
struct Competitor {
    name: &'static str,
    half: bool,
}

/// The competitors, the one that the others are compared with first.
const COMPETITORS: [Competitor; 2] =
    [Competitor { name: "woodbury", half: true }, Competitor { name: "paper", half: false }];

/// Rank 3, and rank up to 21.
const HOMOGENISATIONS: [&str; 2] = ["linear", "laminate"];

/// Vertices that may come in on top of the start mesh.
const GROWTH: usize = 48;

/// Updates before the clock counts: caches, branch predictors and storage have settled then.
const WARM_UP: usize = 6;

/// Fewer updates have no median, more take a day.
const UPDATES: (usize, usize) = (20, 1_000_000);

/// Columns that the drift is measured on.
const DRIFT_COLUMNS: usize = 8;

/// Runs the study, writes its files and returns its table.
///
/// # Errors
/// [`BenchError`] for bad arguments (nothing is written then) or a maintainer that fails.
pub fn run(arguments: &Arguments) -> Result<String, BenchError> {
    if arguments.updates < UPDATES.0 || arguments.updates > UPDATES.1 {
        return Err(BenchError::Updates { value: arguments.updates, limits: UPDATES });
    }
    let mut output = Output::create(&arguments.out, arguments.force)?;
    let size = if arguments.quick { Size::Quick } else { Size::Full };
    let report = measure(size, arguments.updates, arguments.seed)?;
    let table = report.table();
    output.write("inverse.csv", &report.csv())?;
    output.write("inverse.txt", &table)?;
    let json = report.json().map_err(|error| BenchError::Io {
        path: arguments.out.join("inverse.json"),
        source: error.into(),
    })?;
    output.write("inverse.json", &json)?;
    Ok(table)
}

/// Runs all competitors under all homogenisations.
fn measure(size: Size, updates: usize, seed: u64) -> Result<Report, BenchError> {
    let organ = Organ::new(size)?;
    let mut report = Report {
        schema: SCHEMA,
        body: size.name(),
        vertices: organ.forest.vertex_count(),
        free_vertices: organ.free_vertices().count(),
        updates,
        seed,
        threads: std::thread::available_parallelism().map_or(1, usize::from),
        rows: Vec::new(),
        lu: Vec::new(),
    };
    for homogenisation in HOMOGENISATIONS {
        eprintln!("{}, {homogenisation}: {updates} updates ...", size.name());
        let mut race = Race::new(&organ, homogenisation, seed)?;
        for number in 0..WARM_UP + updates {
            race.update(number, number >= WARM_UP)?;
        }
        let (lu, reference) = race.rebuild(homogenisation)?;
        for lane in &race.lanes {
            report.rows.push(lane.row(&race, homogenisation, &reference)?);
        }
        report.lu.push(lu);
    }
    Ok(report)
}

/// All competitors, at the same point of the same history.
struct Race {
    history: History,
    random: SplitMix64,
    stream: Stream,
    lanes: Vec<Lane>,
    ranks: Vec<f64>,
}

/// One competitor with its times, ms, pair by pair with those of the others.
struct Lane {
    maintainer: Box<dyn InverseMaintainer>,
    half: bool,
    split: Samples,
    merge: Samples,
    solve: Samples,
}

/// Times of one kind of operation and of the passes that followed it, ms.
#[derive(Default)]
struct Samples {
    own: Vec<f64>,
    pass: Vec<f64>,
}

impl Race {
    fn new(organ: &Organ, homogenisation: &str, seed: u64) -> Result<Self, BenchError> {
        let history = History::new(organ, homogenisation, GROWTH, seed)?;
        let stiffness = history.stiffness()?;
        let most = 3 * (history.slots().len() + GROWTH);
        let lanes = COMPETITORS
            .iter()
            .map(|competitor| Lane::new(competitor, stiffness.clone()))
            .collect::<Result<_, BenchError>>()?;
        Ok(Self {
            history,
            random: SplitMix64(!seed),
            stream: Stream::new(most * most),
            lanes,
            ranks: Vec::new(),
        })
    }

    /// One split or merge and one solve by everyone.
    fn update(&mut self, number: usize, counts: bool) -> Result<(), BenchError> {
        let update = self.history.step()?;
        let load: Vec<f64> =
            (0..3 * self.history.slots().len()).map(|_| self.random.symmetric()).collect();
        if counts {
            self.ranks.push(update.rank() as f64);
        }
        for turn in 0..self.lanes.len() {
            let at = (number + turn) % self.lanes.len();
            self.lanes[at].update(&update, &mut self.stream, counts)?;
        }
        for turn in 0..self.lanes.len() {
            let at = (number + turn) % self.lanes.len();
            self.lanes[at].solve(&load, &mut self.stream, counts)?;
        }
        Ok(())
    }

    /// One inversion of the final K by LU: its time, and C to compare the others with.
    fn rebuild(&self, homogenisation: &'static str) -> Result<(LuRow, Mat<f64>), BenchError> {
        let stiffness: SparseStiffness = self.history.stiffness()?;
        let begin = Instant::now();
        let lu = Lu::new(stiffness)?;
        let rebuild_ms = milliseconds(begin);
        let all: Vec<usize> = (0..lu.vertices()).collect();
        let drift =
            finite(drift(&lu, 1, DRIFT_COLUMNS), || format!("drift of lu, {homogenisation}"))?;
        let dofs = lu.stiffness().dofs();
        Ok((LuRow { homogenisation, dofs, rebuild_ms, drift }, lu.columns(&all)?))
    }
}

impl Lane {
    fn new(competitor: &Competitor, stiffness: SparseStiffness) -> Result<Self, BenchError> {
        Ok(Self {
            maintainer: build(competitor.name, stiffness)?,
            half: competitor.half,
            split: Samples::default(),
            merge: Samples::default(),
            solve: Samples::default(),
        })
    }

    /// Numbers that C has in this maintainer.
    fn numbers(&self) -> usize {
        let n = self.maintainer.stiffness().dofs();
        if self.half { n * (n + 1) / 2 } else { n * n }
    }

    fn update(
        &mut self,
        update: &Update,
        stream: &mut Stream,
        counts: bool,
    ) -> Result<(), BenchError> {
        let begin = Instant::now();
        update.apply(self.maintainer.as_mut())?;
        let update_ms = milliseconds(begin);
        let pass_ms = self.pass(stream);
        if counts {
            let samples = match update.kind {
                Change::Split => &mut self.split,
                Change::Merge => &mut self.merge,
            };
            samples.own.push(update_ms);
            samples.pass.push(pass_ms);
        }
        Ok(())
    }

    fn solve(&mut self, load: &[f64], stream: &mut Stream, counts: bool) -> Result<(), BenchError> {
        let mut displacement = vec![0.0; load.len()];
        let begin = Instant::now();
        self.maintainer.solve(load, &mut displacement)?;
        let solve_ms = milliseconds(begin);
        let pass_ms = self.pass(stream);
        if counts {
            self.solve.own.push(solve_ms);
            self.solve.pass.push(pass_ms);
        }
        std::hint::black_box(displacement);
        Ok(())
    }

    fn pass(&self, stream: &mut Stream) -> f64 {
        let numbers = self.numbers();
        let begin = Instant::now();
        stream.pass(numbers);
        milliseconds(begin)
    }

    fn row(
        &self,
        race: &Race,
        homogenisation: &'static str,
        reference: &Mat<f64>,
    ) -> Result<Row, BenchError> {
        let first = &race.lanes[0];
        let name = self.maintainer.name();
        let times = |own: &Samples, other: &Samples| Times {
            count: own.own.len(),
            p50_ms: median(&own.own),
            p99_ms: percentile(&own.own, 99.0),
            to_woodbury: median(&ratios(&own.own, &other.own)),
            to_pass: median(&ratios(&own.own, &own.pass)),
        };
        let error = inverse_error(self.maintainer.as_ref(), reference)?;
        let drift = drift(self.maintainer.as_ref(), 1, DRIFT_COLUMNS);
        Ok(Row {
            homogenisation,
            maintainer: name,
            dofs: self.maintainer.stiffness().dofs(),
            rank_p50: median(&race.ranks),
            rank_max: percentile(&race.ranks, 100.0),
            split: times(&self.split, &first.split),
            merge: times(&self.merge, &first.merge),
            solve: times(&self.solve, &first.solve),
            error: finite(error, || format!("error of {name}, {homogenisation}"))?,
            drift: finite(drift, || format!("drift of {name}, {homogenisation}"))?,
            rebuilds: self.maintainer.counts().rebuilds,
        })
    }
}

fn milliseconds(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

/// Refuses to report what JSON can't hold and nobody can read.
fn finite(value: f64, what: impl FnOnce() -> String) -> Result<f64, BenchError> {
    if value.is_finite() { Ok(value) } else { Err(BenchError::NotFinite { what: what(), value }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(out: PathBuf, updates: usize) -> Arguments {
        Arguments { out, quick: true, updates, seed: 2, force: false }
    }

    #[test]
    fn the_study_times_both_maintainers_and_both_stay_right() {
        let report = measure(Size::Quick, 40, 2).unwrap();
        let names: Vec<_> = report.rows.iter().map(|r| (r.homogenisation, r.maintainer)).collect();
        let want = [("linear", "woodbury"), ("linear", "paper")];
        assert_eq!(names[..2], want);
        assert_eq!(names[2..], want.map(|(_, maintainer)| ("laminate", maintainer)));
        for row in &report.rows {
            assert_eq!(row.split.count + row.merge.count, 40);
            assert_eq!(row.solve.count, 40);
            for times in [&row.split, &row.merge, &row.solve] {
                assert!(times.p50_ms > 0.0 && times.p99_ms >= times.p50_ms, "{times:?}");
                assert!(times.to_woodbury > 0.0 && times.to_pass > 0.0, "{times:?}");
            }
            if row.maintainer == "woodbury" {
                assert_eq!(row.split.to_woodbury, 1.0);
            }
            // Far above the rounding of 46 updates and of LU, far below a wrong update.
            assert!(row.error < 1e-8 && row.drift < 1e-8, "{row:?}");
            assert_eq!(row.rebuilds, 0);
        }
        assert!(report.rows[0].rank_max == 3.0 && report.rows[2].rank_max > 3.0);
    }

    #[test]
    fn a_pass_goes_over_what_the_maintainer_stores() {
        let mut stiffness = SparseStiffness::zeros(2, 3).unwrap();
        stiffness.add(&[0, 1], Mat::<f64>::identity(6, 6).as_ref()).unwrap();
        let numbers = COMPETITORS.map(|c| Lane::new(&c, stiffness.clone()).unwrap().numbers());
        // Rows of 1, 2 … 6 numbers, and six of six.
        assert_eq!(numbers, [21, 36]);
    }

    #[test]
    fn files_are_whole_tables() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("study");
        let table = run(&arguments(out.clone(), 20)).unwrap();
        assert_eq!(std::fs::read_to_string(out.join("inverse.txt")).unwrap(), table);
        let csv = std::fs::read_to_string(out.join("inverse.csv")).unwrap();
        // Header; split, merge and solve of 2 × 2 competitors; 2 rebuilds.
        assert_eq!(csv.lines().count(), 1 + 3 * 4 + 2);
        let commas: Vec<_> = csv.lines().map(|line| line.matches(',').count()).collect();
        assert!(commas.iter().all(|&count| count == commas[0]), "{csv}");
        let json = std::fs::read_to_string(out.join("inverse.json")).unwrap();
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(value["schema"], SCHEMA);
        assert!(!json.contains("null"), "{json}");
    }

    #[test]
    fn bad_arguments_write_nothing() {
        let root = tempfile::tempdir().unwrap();
        let error = run(&arguments(root.path().join("study"), UPDATES.0 - 1)).unwrap_err();
        assert!(matches!(error, BenchError::Updates { .. }), "{error}");
        assert!(std::fs::read_dir(root.path()).unwrap().next().is_none());
    }
}
