//! `drift`: what 10⁴ random splits, merges and changes of material leave of the inverse, and
//! whether its monitor sees it; `report.rs` has the rows, the claims and the tables.

mod report;

use clap::Args;
use yawara_embed::Material;
use yawara_inverse_update::{InverseMaintainer, build, drift};

use crate::bodies::organ::Organ;
use crate::error::Result;
use crate::harness::arguments::{Common, in_range, sizes};
use crate::harness::report::write;
use crate::harness::{Machine, Progress};
use crate::solvers::{Reference, Trial, in_one_thread};
use crate::studies::race::maintainers;
use crate::workloads::{History, MaterialEdits, SplitMix64};
use report::{MONITORED, Row, summary};

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// Numbers of free vertices, separated by commas [default: 512].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub vertices: Vec<usize>,
    /// Splits, merges and changes, all together [default: 10000].
    #[arg(long, value_name = "N")]
    pub updates: Option<usize>,
    /// Picks the mesh, the places and the loads.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Materials of the organ's labels, softest first: E in equal ratios, ν in equal steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Case {
    pub e_ratio: f64,
    pub poisson: [f64; 2],
}

const E_RATIOS: [f64; 3] = [1.0, 1e3, 1e6];

const POISSON: [[f64; 2]; 4] = [[0.3, 0.3], [0.3, 0.499], [0.499, 0.499], [0.4999, 0.4999]];

/// E of the softest material, Pa.
const SOFTEST_PA: f64 = 1e3;

/// Vertices that come in or go out on top of the size.
const WANDER: usize = 24;

/// Between one and a day's worth.
const UPDATES: (usize, usize) = (1, 10_000_000);

/// One update in so many is a change of material.
const CHANGES: usize = 3;

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    let quick = arguments.common.quick;
    let vertices = sizes(&arguments.vertices, if quick { &[192] } else { &[512] })?;
    let updates = arguments.updates.unwrap_or(if quick { 300 } else { 10_000 });
    in_range("--updates", updates, UPDATES)?;
    let folder = arguments.common.folder()?;
    let (cases, seed) = (cases(quick), arguments.seed);
    let mut progress = Progress::new((vertices.len() * cases.len() * updates) as f64);
    let mut rows = Vec::new();
    for &vertices in &vertices {
        for &case in &cases {
            let run = Run { case, vertices, updates, seed };
            rows.extend(in_one_thread(|| run.rows(&mut progress))?);
        }
    }
    drop(progress);
    let summary = summary(&rows).with("machine", Machine::here()).with("seed", seed);
    write(&folder, "drift", &rows, summary)
}

fn cases(quick: bool) -> Vec<Case> {
    let all = E_RATIOS
        .into_iter()
        .flat_map(|e_ratio| POISSON.into_iter().map(move |poisson| Case { e_ratio, poisson }));
    if quick { all.step_by(5).collect() } else { all.collect() }
}

impl Case {
    /// The materials of `count` labels.
    fn materials(&self, count: usize) -> Result<Vec<Material>> {
        let [low, high] = self.poisson;
        let material = |label: usize| {
            let at = label as f64 / (count - 1).max(1) as f64;
            Material::new(SOFTEST_PA * self.e_ratio.powf(at), low + at * (high - low), 1000.0)
        };
        Ok((0..count).map(material).collect::<Result<_, _>>()?)
    }
}

/// One random history under one choice of materials.
struct Run {
    case: Case,
    vertices: usize,
    updates: usize,
    seed: u64,
}

/// What is done to all maintainers.
type Step = Box<dyn Fn(&mut dyn InverseMaintainer) -> Result<()>>;

impl Run {
    fn rows(&self, progress: &mut Progress) -> Result<Vec<Row>> {
        let mut organ = Organ::with_at_most(self.vertices)?;
        organ.materials = self.case.materials(organ.materials.len())?;
        let mut history = History::refined(&organ, "laminate", self.vertices, WANDER, self.seed)?;
        let mut edits = MaterialEdits::new(&organ, "laminate")?;
        let mut random = SplitMix64(!self.seed);
        let stiffness = history.stiffness()?;
        let mut kept = maintainers()
            .map(|name| build(name, stiffness.clone()))
            .collect::<Result<Vec<_>, _>>()?;
        let mut rows = Vec::new();
        let what = format!("E ratio {:e}, ν {:?}", self.case.e_ratio, self.case.poisson);
        for number in 1..=self.updates {
            let changes = random.below(CHANGES) == 0;
            let change = if changes { edits.step(history.slots(), &mut random)? } else { None };
            let step: Step = if let Some(change) = change {
                Box::new(move |maintainer| Ok(maintainer.change(&change)?))
            } else {
                let update = history.step()?;
                Box::new(move |maintainer| update.apply(maintainer))
            };
            // Who refuses a valid step is out of the race.
            kept.retain_mut(|maintainer| step(maintainer.as_mut()).is_ok());
            if is_looked_at(number, self.updates) {
                let mut k = history.stiffness()?;
                edits.add_to(&mut k, history.slots())?;
                self.look(number, &Reference::new(k)?, &kept, &mut rows)?;
            }
            progress.advance(&what, 1.0);
        }
        Ok(rows)
    }

    /// Errors and monitor of all maintainers.
    fn look(
        &self,
        updates: usize,
        reference: &Reference,
        kept: &[Box<dyn InverseMaintainer>],
        rows: &mut Vec<Row>,
    ) -> Result<()> {
        let trial = Trial::new(reference, SplitMix64(self.seed ^ updates as u64))?;
        for maintainer in kept {
            // A maintainer that can't solve any more has lost everything.
            let solved = |load: &[f64]| {
                let mut u = vec![0.0; load.len()];
                Ok(maintainer.solve(load, &mut u).map_or_else(|_| Vec::new(), |()| u))
            };
            let columns = maintainer.columns(&trial.tool)?;
            let [error, columns_error] = trial.errors(&columns, solved)?;
            let monitor = drift(maintainer.as_ref(), self.seed ^ updates as u64, MONITORED);
            let finite = |value: f64| value.is_finite().then_some(value);
            rows.push(Row {
                e_ratio: self.case.e_ratio,
                poisson_low: self.case.poisson[0],
                poisson_high: self.case.poisson[1],
                vertices: self.vertices,
                method: maintainer.name(),
                precision: if maintainer.name().ends_with("_f32") { "f32" } else { "f64" },
                updates,
                error: finite(error),
                columns_error: finite(columns_error),
                monitor: finite(monitor),
                rebuilds: maintainer.counts().rebuilds,
            });
        }
        Ok(())
    }
}

/// After 1, 2, 5, 10, 20, 50 … updates, and after the last.
fn is_looked_at(number: usize, last: usize) -> bool {
    let mut digits = number;
    while digits.is_multiple_of(10) && digits > 0 {
        digits /= 10;
    }
    number == last || [1, 2, 5].contains(&digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_looks_per_decade_and_one_at_the_end() {
        let looks: Vec<usize> = (1..=130).filter(|&n| is_looked_at(n, 130)).collect();
        assert_eq!(looks, [1, 2, 5, 10, 20, 50, 100, 130]);
    }

    #[test]
    fn materials_span_their_ranges() {
        let case = Case { e_ratio: 1e6, poisson: [0.3, 0.499] };
        let materials = case.materials(5).unwrap();
        let e: Vec<f64> = materials.iter().map(|m| m.young_modulus_pa()).collect();
        assert!((e[4] / e[0] / 1e6 - 1.0).abs() < 1e-12 && (e[2] / e[0] / 1e3 - 1.0).abs() < 1e-12);
        assert_eq!((materials[0].poisson_ratio(), materials[4].poisson_ratio()), (0.3, 0.499));
        assert_eq!(cases(false).len(), 12);
        let quick: Vec<f64> = cases(true).iter().map(|case| case.e_ratio).collect();
        assert_eq!(quick, E_RATIOS);
    }
}
