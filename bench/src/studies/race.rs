//! All maintainers and direct methods at one size, side by side, with the bound of memory.
//!
//! Every family of rings has the same mesh and the same places of splits and merges. Updates come
//! in bursts: within one, a method finds its own numbers in the caches, as it does in use; from
//! burst to burst the methods take turns and another one begins, so that all of them meet the
//! same machine.

mod course;
mod growth;
mod lane;
mod memory;
mod ratios;
mod row;

use serde::Serialize;
use yawara_inverse_update::{CHOICES, SparseStiffness};

use course::Course;
pub(crate) use growth::Growth;
pub(crate) use lane::{Lane, Samples, three_slots, unit_loads};
pub(crate) use memory::Memory;
pub(crate) use ratios::{Ratio, ratios};
pub(crate) use row::{Quantiles, Row, csv};

use crate::direct::{DIRECT, Direct};
use crate::error::BenchError;
use crate::history::History;
use crate::organ::Organ;
use crate::progress::Progress;
use crate::random::SplitMix64;
use crate::reference::Reference;
use crate::statistics::median;

/// Rings of one kind, by the homogenisation that makes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Family {
    pub name: &'static str,
    pub homogenisation: &'static str,
}

/// Rank 3 everywhere; rank 3 in homogeneous rings and up to 21 in others.
pub(crate) const FAMILIES: [Family; 2] = [
    Family { name: "rank3", homogenisation: "linear" },
    Family { name: "laminate", homogenisation: "laminate" },
];

/// Pairs of a burst that count; one more comes first and does not.
pub(crate) const BURST: usize = 5;

/// Rebuilds of a direct method at one size, where the time cap allows them.
const REBUILDS: usize = 5;

/// What is to be measured.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Free vertices, ascending.
    pub vertices: Vec<usize>,
    pub direct: &'static [Direct],
    /// Pairs of a split and a merge that are timed, in whole bursts.
    pub pairs: usize,
    /// Seconds that one method may take at one size, in one family.
    pub cap_s: f64,
    /// Bytes that one method may hold.
    pub memory_bytes: f64,
    pub seed: u64,
}

impl Settings {
    fn bursts(&self) -> usize {
        self.pairs.div_ceil(BURST)
    }
}

/// A method that was not measured at a size, and why.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LeftOut {
    pub vertices: usize,
    pub method: &'static str,
    pub family: &'static str,
    pub reason: String,
}

/// Everything measured at one size.
pub(crate) struct Field {
    pub vertices: usize,
    pub rows: Vec<Row>,
    pub lanes: Vec<Lane>,
    pub left_out: Vec<LeftOut>,
    pub memory: Memory,
}

/// Names of [`CHOICES`] that are updated: the others are direct methods by themselves.
pub(crate) fn maintainers() -> impl Iterator<Item = &'static str> {
    CHOICES.iter().copied().filter(|name| DIRECT.iter().all(|direct| direct.name() != *name))
}

/// Units of work of one size, for the time left: between the updates of a dense method and its
/// start.
pub(crate) fn work(vertices: usize) -> f64 {
    (vertices as f64).powf(2.5)
}

/// Half of C with its diagonal, for `dofs` rows.
fn packed(dofs: usize) -> usize {
    dofs * (dofs + 1) / 2
}

/// Runs all sizes one after the other; what the smaller ones took tells what the larger ones will.
///
/// # Errors
/// [`BenchError`] from the mesh, the homogenisation or a method that fails.
pub(crate) fn run(settings: &Settings, progress: &mut Progress) -> Result<Vec<Field>, BenchError> {
    let mut growth = Growth::default();
    let mut fields = Vec::new();
    for &vertices in &settings.vertices {
        let mut race = Race::new(settings, vertices, &mut growth, progress)?;
        let bursts = settings.bursts();
        for number in 0..bursts {
            race.burst(number)?;
            progress.advance(&format!("{vertices} vertices"), 0.5 * work(vertices) / bursts as f64);
        }
        fields.push(race.finish(&mut growth)?);
    }
    Ok(fields)
}

/// One size under way.
struct Race<'a> {
    settings: &'a Settings,
    vertices: usize,
    courses: Vec<Course>,
    lanes: Vec<Lane>,
    left_out: Vec<LeftOut>,
    predicted: Vec<Row>,
    memory: Memory,
}

impl<'a> Race<'a> {
    fn new(
        settings: &'a Settings,
        vertices: usize,
        growth: &mut Growth,
        progress: &mut Progress,
    ) -> Result<Self, BenchError> {
        let organ = Organ::with_at_most(vertices)?;
        let mut race = Self {
            settings,
            vertices,
            courses: Vec::new(),
            lanes: Vec::new(),
            left_out: Vec::new(),
            predicted: Vec::new(),
            memory: Memory::default(),
        };
        for family in FAMILIES {
            let seed = settings.seed;
            let history = History::refined(&organ, family.homogenisation, vertices, 0, seed)?;
            let stiffness = history.stiffness()?;
            race.courses.push(Course { family, history, ranks: Vec::new(), reference: None });
            for name in maintainers() {
                race.enter(name, &stiffness, growth)?;
            }
            for &direct in settings.direct {
                race.enter_direct(direct, growth);
            }
            let share = 0.5 / FAMILIES.len() as f64;
            progress.advance(&format!("{vertices} vertices"), share * work(vertices));
        }
        if race.lanes.iter().any(Lane::is_dense) {
            race.memory = Memory::new(packed(3 * vertices));
        }
        Ok(race)
    }

    /// Starts a maintainer, unless it would take too much.
    fn enter(
        &mut self,
        name: &'static str,
        stiffness: &SparseStiffness,
        growth: &mut Growth,
    ) -> Result<(), BenchError> {
        let course = self.courses.len() - 1;
        let family = self.courses[course].family.name;
        let dofs = 3 * self.vertices;
        let expected = growth.expect((name, family, "build"), dofs);
        if let Some(reason) = self.too_much(name, expected) {
            let vertices = self.vertices;
            self.left_out.push(LeftOut { vertices, method: name, family, reason });
            return Ok(());
        }
        let lane = Lane::maintainer(name, course, stiffness.clone())?;
        if let Some(build_ms) = lane.build_ms {
            growth.note((name, family, "build"), dofs, build_ms);
        }
        self.lanes.push(lane);
        Ok(())
    }

    /// Enters a direct method, its figure extrapolated if it would take too much.
    fn enter_direct(&mut self, direct: Direct, growth: &Growth) {
        let course = self.courses.len() - 1;
        let family = self.courses[course].family.name;
        let (name, dofs, vertices) = (direct.name(), 3 * self.vertices, self.vertices);
        let expected = growth.expect((name, family, "split"), dofs);
        let Some(reason) = self.too_much(name, expected) else {
            let cap = 1e3 * self.settings.cap_s;
            let rebuilds = expected.map_or(REBUILDS as f64, |ms| cap / ms);
            let rebuilds = (rebuilds as usize).clamp(1, REBUILDS);
            self.lanes.push(Lane::direct(direct, course, rebuilds));
            return;
        };
        match growth.fitted((name, family, "split"), dofs) {
            Some(ms) => self.predicted.push(Row::extrapolated(name, family, vertices, ms)),
            None => self.left_out.push(LeftOut { vertices, method: name, family, reason }),
        }
    }

    fn too_much(&self, name: &str, expected_ms: Option<f64>) -> Option<String> {
        let dofs = 3.0 * self.vertices as f64;
        // K, its factor and C, dense, stand side by side while a dense method begins.
        let bytes = if lane::is_sparse(name) { 0.0 } else { 3.0 * 8.0 * dofs * dofs };
        if bytes > self.settings.memory_bytes {
            let limit = self.settings.memory_bytes / 1e9;
            return Some(format!("needs {:.2} GB, limit {limit:.2} GB", bytes / 1e9));
        }
        let seconds = expected_ms? / 1e3;
        let cap = self.settings.cap_s;
        (seconds > cap).then(|| format!("would take {seconds:.0} s once, limit {cap} s"))
    }

    /// A burst by everyone, in turns.
    fn burst(&mut self, number: usize) -> Result<(), BenchError> {
        // All families get the same loads and tools.
        let random = SplitMix64(!self.settings.seed ^ number as u64);
        let bursts = self.courses.iter_mut().map(|course| course.burst(random));
        let bursts = bursts.collect::<Result<Vec<_>, _>>()?;
        let turns = self.lanes.len() + 1;
        for turn in 0..turns {
            let at = (number + turn) % turns;
            match self.lanes.get_mut(at) {
                Some(lane) if lane.runs(number, self.settings.bursts()) => {
                    let course = &self.courses[lane.course];
                    lane.burst(number, &bursts[lane.course], || course.history.stiffness())?;
                    if number == 0 {
                        lane.limit_to(self.settings);
                    }
                }
                Some(_) => {}
                None => self.memory.burst(number),
            }
        }
        self.judge(number)
    }

    /// The errors of those who have run their last burst.
    fn judge(&mut self, number: usize) -> Result<(), BenchError> {
        let bursts = self.settings.bursts();
        for course in &mut self.courses {
            course.reference = None;
        }
        for lane in &mut self.lanes {
            if lane.last_burst(bursts) != Some(number) {
                continue;
            }
            let course = &mut self.courses[lane.course];
            if course.reference.is_none() {
                course.reference = Some(Reference::new(course.history.stiffness()?)?);
            }
            if let Some(reference) = &course.reference {
                lane.judge(reference, self.settings.seed)?;
            }
        }
        Ok(())
    }

    fn finish(mut self, growth: &mut Growth) -> Result<Field, BenchError> {
        self.memory.free();
        let dofs = 3 * self.vertices;
        let mut rows = Vec::new();
        for lane in &self.lanes {
            let course = &self.courses[lane.course];
            let bound = self.memory.bound(lane.precision());
            let row = Row::measured(lane, course.family.name, self.vertices, bound, &course.ranks)?;
            growth.note((lane.name, course.family.name, "split"), dofs, row.split_ms.p50);
            rows.push(row);
        }
        rows.extend(self.predicted);
        rows.sort_by_key(|row| FAMILIES.iter().position(|family| family.name == row.family));
        Ok(Field {
            vertices: self.vertices,
            rows,
            lanes: self.lanes,
            left_out: self.left_out,
            memory: self.memory,
        })
    }
}

/// Median over the bursts that both have of the ratio of their medians; NaN without any.
pub(crate) fn ratio(a: &Samples, b: &Samples) -> f64 {
    let ratios: Vec<f64> = a
        .bursts()
        .filter_map(|(number, times)| Some(median(times) / median(b.burst(number)?)))
        .collect();
    median(&ratios)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::organ::Size;

    fn race(settings: &Settings) -> Race<'_> {
        let organ = Organ::new(Size::Quick).unwrap();
        let history = History::refined(&organ, "linear", 160, 0, 1).unwrap();
        let family = FAMILIES[0];
        Race {
            settings,
            vertices: 1000,
            courses: vec![Course { family, history, ranks: Vec::new(), reference: None }],
            lanes: Vec::new(),
            left_out: Vec::new(),
            predicted: Vec::new(),
            memory: Memory::default(),
        }
    }

    #[test]
    fn what_would_take_too_long_is_extrapolated_or_left_out() {
        let settings = Settings {
            vertices: vec![1000],
            direct: &DIRECT,
            pairs: 10,
            cap_s: 60.0,
            memory_bytes: 1e9,
            seed: 1,
        };
        let mut race = race(&settings);
        let mut growth = Growth::default();
        // 1 s and 8 s: 1000 s at 3000 rows.
        growth.note(("lu", "rank3", "split"), 300, 1e3);
        growth.note(("lu", "rank3", "split"), 600, 8e3);
        growth.note(("cholesky", "rank3", "split"), 300, 1e3);
        growth.note(("sparse_refactor_amd", "rank3", "split"), 1500, 1e4);
        DIRECT.iter().for_each(|&direct| race.enter_direct(direct, &growth));
        let [lu] = &race.predicted[..] else { panic!("{:?}", race.predicted) };
        assert!(lu.extrapolated && lu.method == "lu");
        assert!((lu.split_ms.p50 / 1e6 - 1.0).abs() < 1e-9, "{lu:?}");
        let [cholesky] = &race.left_out[..] else { panic!("{:?}", race.left_out) };
        assert_eq!((cholesky.method, cholesky.vertices), ("cholesky", 1000));
        assert_eq!(cholesky.reason, "would take 1000 s once, limit 60 s");
        let names: Vec<&str> = race.lanes.iter().map(|lane| lane.name).collect();
        assert_eq!(names, ["sparse_refactor_amd", "sparse_refactor_nd"]);
        // 40 s at 3000 rows, limit 60: a single rebuild in two bursts.
        assert_eq!(race.lanes[0].last_burst(2), Some(0));
    }

    #[test]
    fn ratios_compare_bursts_that_both_have() {
        let samples = |bursts: &[(usize, f64)]| {
            let mut samples = Samples::default();
            bursts.iter().for_each(|&(number, time)| samples.push(number, time));
            samples
        };
        let a = samples(&[(0, 9.0), (0, 6.0), (0, 1.0), (1, 40.0), (2, 5.0)]);
        let b = samples(&[(0, 3.0), (1, 10.0), (3, 7.0)]);
        // 6 / 3 and 40 / 10: the lower median of two.
        assert_eq!(ratio(&a, &b), 2.0);
        assert!(ratio(&a, &samples(&[(4, 1.0)])).is_nan());
    }
}
