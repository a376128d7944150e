//! A race: all maintainers and direct methods side by side, at one size after the other.
//!
//! Every family of rings has the same mesh and the same places of splits and merges. Updates come
//! in bursts: within one, a method finds its own numbers in the caches, as it does in use; from
//! burst to burst the methods take turns and another one begins, so that all of them meet the
//! same machine. `workload.rs` makes the bursts, `competitor.rs` runs them, `row.rs` and
//! `ratios.rs` say what was found, `tables.rs` shows it.

mod competitor;
mod growth;
mod memory;
mod ratios;
mod row;
mod samples;
mod settings;
mod tables;
mod workload;

use yawara_inverse_update::SparseStiffness;

use crate::bodies::organ::Organ;
use crate::error::Result;
use crate::harness::Progress;
use crate::solvers::{Direct, Reference};
use crate::workloads::{History, SplitMix64};

use competitor::Competitor;
use growth::Growth;
use memory::Memory;
use settings::{LeftOut, Settings, is_sparse};
use workload::Workload;

pub(crate) use memory::Speed;
pub(crate) use ratios::{AtSize, beside, rows};
pub(crate) use row::Row;
pub use settings::Arguments;
pub(crate) use settings::{Defaults, FAMILIES, maintainers};
pub(crate) use tables::{families, head, left_out, lines, ratio_table};

/// Rebuilds of a direct method at one size, where the time cap allows them.
const REBUILDS: usize = 5;

/// Units of work of one size, for the time left: between the updates of a dense method and its
/// start.
fn work(vertices: usize) -> f64 {
    (vertices as f64).powf(2.5)
}

/// Half of C with its diagonal, for `dofs` rows.
fn packed(dofs: usize) -> usize {
    dofs * (dofs + 1) / 2
}

/// Runs all sizes one after the other; what the smaller ones took tells what the larger ones will.
pub(crate) fn run(settings: &Settings) -> Result<Vec<AtSize>> {
    let mut progress = Progress::new(settings.vertices.iter().map(|&n| work(n)).sum());
    let mut growth = Growth::default();
    let mut sizes = Vec::new();
    for &vertices in &settings.vertices {
        let mut race = Race::new(settings, vertices, &mut growth, &mut progress)?;
        let bursts = settings.bursts();
        for number in 0..bursts {
            race.burst(number)?;
            progress.advance(&format!("{vertices} vertices"), 0.5 * work(vertices) / bursts as f64);
        }
        sizes.push(race.finish(&mut growth)?);
    }
    Ok(sizes)
}

/// One size under way.
struct Race<'a> {
    settings: &'a Settings,
    workloads: Vec<Workload>,
    /// Its rows are those that are extrapolated, until the end.
    size: AtSize,
}

impl<'a> Race<'a> {
    fn new(
        settings: &'a Settings,
        vertices: usize,
        growth: &mut Growth,
        progress: &mut Progress,
    ) -> Result<Self> {
        let organ = Organ::with_at_most(vertices)?;
        let size = AtSize { vertices, ..AtSize::default() };
        let mut race = Self { settings, workloads: Vec::new(), size };
        for family in FAMILIES {
            let seed = settings.seed;
            let history = History::refined(&organ, family.homogenisation, vertices, 0, seed)?;
            let stiffness = history.stiffness()?;
            race.workloads.push(Workload::new(history));
            for name in maintainers() {
                race.enter(name, &stiffness, growth)?;
            }
            for &direct in settings.direct {
                race.enter_direct(direct, growth);
            }
            let share = 0.5 / FAMILIES.len() as f64;
            progress.advance(&format!("{vertices} vertices"), share * work(vertices));
        }
        if race.size.competitors.iter().any(Competitor::is_dense) {
            race.size.memory = Memory::new(packed(3 * vertices));
        }
        Ok(race)
    }

    /// Number and name of the family that enters.
    fn entering(&self) -> (usize, &'static str) {
        let workload = self.workloads.len() - 1;
        (workload, FAMILIES[workload].name)
    }

    fn leave_out(&mut self, method: &'static str, reason: String) {
        let (vertices, (_, family)) = (self.size.vertices, self.entering());
        self.size.left_out.push(LeftOut { vertices, method, family, reason });
    }

    /// Starts a maintainer, unless it would take too much.
    fn enter(
        &mut self,
        name: &'static str,
        stiffness: &SparseStiffness,
        growth: &mut Growth,
    ) -> Result<()> {
        let ((workload, family), dofs) = (self.entering(), 3 * self.size.vertices);
        let key = (name, family, "build");
        if let Some(reason) = self.too_much(name, growth.expect(key, dofs)) {
            self.leave_out(name, reason);
            return Ok(());
        }
        let competitor = Competitor::maintainer(name, workload, stiffness.clone())?;
        if let Some(build_ms) = competitor.build_ms {
            growth.note(key, dofs, build_ms);
        }
        self.size.competitors.push(competitor);
        Ok(())
    }

    /// Enters a direct method, its figure extrapolated if it would take too much.
    fn enter_direct(&mut self, direct: Direct, growth: &Growth) {
        let ((workload, family), vertices) = (self.entering(), self.size.vertices);
        let key = (direct.name(), family, "split");
        let expected = growth.expect(key, 3 * vertices);
        let Some(reason) = self.too_much(direct.name(), expected) else {
            let cap = 1e3 * self.settings.cap_s;
            let rebuilds = expected.map_or(REBUILDS as f64, |ms| cap / ms);
            let rebuilds = (rebuilds as usize).clamp(1, REBUILDS);
            self.size.competitors.push(Competitor::direct(direct, workload, rebuilds));
            return;
        };
        match growth.fitted(key, 3 * vertices) {
            Some(ms) => {
                self.size.rows.push(Row::extrapolated(direct.name(), family, vertices, ms));
            }
            None => self.leave_out(direct.name(), reason),
        }
    }

    fn too_much(&self, name: &str, expected_ms: Option<f64>) -> Option<String> {
        let dofs = 3.0 * self.size.vertices as f64;
        // K, its factor and C, dense, stand side by side while a dense method begins.
        let bytes = if is_sparse(name) { 0.0 } else { 3.0 * 8.0 * dofs * dofs };
        if bytes > self.settings.memory_bytes {
            let limit = self.settings.memory_bytes / 1e9;
            return Some(format!("needs {:.2} GB, limit {limit:.2} GB", bytes / 1e9));
        }
        let seconds = expected_ms? / 1e3;
        let cap = self.settings.cap_s;
        (seconds > cap).then(|| format!("would take {seconds:.0} s once, limit {cap} s"))
    }

    /// A burst by everyone, in turns.
    fn burst(&mut self, number: usize) -> Result<()> {
        // All families get the same loads and tools.
        let random = SplitMix64(!self.settings.seed ^ number as u64);
        let bursts = self.workloads.iter_mut().map(|workload| workload.burst(random));
        let bursts = bursts.collect::<Result<Vec<_>, _>>()?;
        let turns = self.size.competitors.len() + 1;
        for turn in 0..turns {
            let at = (number + turn) % turns;
            match self.size.competitors.get_mut(at) {
                Some(competitor) if competitor.runs(number, self.settings.bursts()) => {
                    let workload = &self.workloads[competitor.workload];
                    competitor.burst(number, &bursts[competitor.workload], || {
                        workload.history.stiffness()
                    })?;
                    if number == 0 {
                        competitor.limit_to(self.settings);
                    }
                }
                Some(_) => {}
                None => self.size.memory.burst(number),
            }
        }
        self.judge(number)
    }

    /// The errors of those who have run their last burst.
    fn judge(&mut self, number: usize) -> Result<()> {
        let bursts = self.settings.bursts();
        for (at, workload) in self.workloads.iter().enumerate() {
            let is_due = |one: &&mut Competitor| {
                one.workload == at && one.last_burst(bursts) == Some(number)
            };
            let mut due = self.size.competitors.iter_mut().filter(is_due).peekable();
            if due.peek().is_some() {
                let reference = Reference::new(workload.history.stiffness()?)?;
                due.try_for_each(|competitor| competitor.judge(&reference, self.settings.seed))?;
            }
        }
        Ok(())
    }

    fn finish(self, growth: &mut Growth) -> Result<AtSize> {
        let Self { workloads, mut size, .. } = self;
        size.memory.free();
        let mut rows = Vec::new();
        for competitor in &size.competitors {
            let ranks = &workloads[competitor.workload].ranks;
            let bound = size.memory.bound(competitor.precision());
            let row = Row::measured(competitor, size.vertices, bound, ranks)?;
            growth.note((row.method, row.family, "split"), row.dofs, row.split_ms.p50);
            rows.push(row);
        }
        rows.append(&mut size.rows);
        rows.sort_by_key(|row| FAMILIES.iter().position(|family| family.name == row.family));
        Ok(AtSize { rows, ..size })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::organ::Size;
    use crate::solvers::direct::DIRECT;

    fn race(settings: &Settings) -> Race<'_> {
        let organ = Organ::new(Size::Quick).unwrap();
        let history = History::refined(&organ, "linear", 160, 0, 1).unwrap();
        let workloads = vec![Workload::new(history)];
        Race { settings, workloads, size: AtSize { vertices: 1000, ..AtSize::default() } }
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
        let known = [("lu", 300, 1e3), ("lu", 600, 8e3), ("cholesky", 300, 1e3)];
        for (method, dofs, ms) in known.into_iter().chain([("sparse_refactor_amd", 1500, 1e4)]) {
            growth.note((method, "rank3", "split"), dofs, ms);
        }
        DIRECT.iter().for_each(|&direct| race.enter_direct(direct, &growth));
        let Race { size: AtSize { rows, left_out, competitors, .. }, .. } = &race;
        let [lu] = &rows[..] else { panic!("{rows:?}") };
        assert!(lu.extrapolated && lu.method == "lu");
        assert!((lu.split_ms.p50 / 1e6 - 1.0).abs() < 1e-9, "{lu:?}");
        let [cholesky] = &left_out[..] else { panic!("{left_out:?}") };
        assert_eq!((cholesky.method, cholesky.vertices), ("cholesky", 1000));
        assert_eq!(cholesky.reason, "would take 1000 s once, limit 60 s");
        let names: Vec<&str> = competitors.iter().map(|competitor| competitor.name).collect();
        assert_eq!(names, ["sparse_refactor_amd", "sparse_refactor_nd"]);
        // 40 s at 3000 rows, limit 60: a single rebuild in two bursts.
        assert_eq!(competitors[0].last_burst(2), Some(0));
    }
}
