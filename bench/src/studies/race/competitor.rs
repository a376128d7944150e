//! One method in a race: what it runs and how long that took.

use std::hint::black_box;
use std::time::Instant;

use faer::Mat;
use yawara_inverse_update::{InverseMaintainer, SparseStiffness, build, drift};
use yawara_mesh::Change;

use super::samples::{Samples, timed};
use super::settings::{BURST, FAMILIES, Settings, is_sparse};
use super::workload::Burst;
use crate::error::Result;
use crate::harness::statistics::milliseconds_since;
use crate::solvers::{Direct, Reference, Solver, Trial};
use crate::workloads::random::SplitMix64;

/// Columns that the drift is measured on.
const DRIFT_COLUMNS: usize = 8;

/// How far the solutions are from the reference at the end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Errors {
    /// The largest relative error of `solve`, for a random load and the unit loads of a tool.
    pub solve: f64,
    /// The largest relative error of the tool's `columns`.
    pub columns: f64,
    /// The monitor's figure; only a maintainer has one.
    pub drift: Option<f64>,
    /// Fresh starts by itself; only a maintainer counts them.
    pub rebuilds: Option<usize>,
    /// Which factor the reference was solved by.
    pub reference: &'static str,
}

#[derive(Default)]
enum Runner {
    Kept(Box<dyn InverseMaintainer>),
    Direct {
        method: Direct,
        rebuilds: usize,
        solver: Option<Solver>,
    },
    /// Judged; its memory is free for others.
    #[default]
    Done,
}

/// One method in one family.
#[derive(Default)]
pub(crate) struct Competitor {
    pub name: &'static str,
    pub workload: usize,
    runner: Runner,
    /// Bursts that it may take part in.
    limit: usize,
    spent_ms: f64,
    /// Time of the start, ms; a direct method does nothing else.
    pub build_ms: Option<f64>,
    /// Splits and, for a direct method, rebuilds.
    pub split: Samples,
    /// The first split of each burst, before the caches hold what it needs.
    pub cold_split: Samples,
    /// Merges of the newest vertex.
    pub merge: Samples,
    /// Merges of any other.
    pub old_merge: Samples,
    pub solve: Samples,
    pub columns: Samples,
    pub errors: Option<Errors>,
}

impl Competitor {
    /// Builds a maintainer by its name.
    pub fn maintainer(
        name: &'static str,
        workload: usize,
        stiffness: SparseStiffness,
    ) -> Result<Self> {
        let begin = Instant::now();
        let kept = build(name, stiffness)?;
        let build_ms = Some(milliseconds_since(begin));
        Ok(Self { build_ms, ..Self::new(name, workload, Runner::Kept(kept)) })
    }

    /// A direct method that rebuilds so many times, evenly spread over the bursts.
    pub fn direct(method: Direct, workload: usize, rebuilds: usize) -> Self {
        let runner = Runner::Direct { method, rebuilds, solver: None };
        Self::new(method.name(), workload, runner)
    }

    fn new(name: &'static str, workload: usize, runner: Runner) -> Self {
        Self { name, workload, runner, limit: usize::MAX, ..Self::default() }
    }

    pub fn is_dense(&self) -> bool {
        !is_sparse(self.name)
    }

    pub fn family(&self) -> &'static str {
        FAMILIES[self.workload].name
    }

    /// Of what it stores, by its name.
    pub fn precision(&self) -> &'static str {
        if self.name.ends_with("_f32") { "f32" } else { "f64" }
    }

    /// It runs in every so manieth burst; none once it is judged.
    fn stride(&self, bursts: usize) -> Option<usize> {
        match self.runner {
            Runner::Kept(_) => Some(1),
            Runner::Direct { rebuilds, .. } => Some(bursts.div_ceil(rebuilds)),
            Runner::Done => None,
        }
    }

    /// Number of the burst after which the errors are taken.
    pub fn last_burst(&self, bursts: usize) -> Option<usize> {
        let stride = self.stride(bursts)?;
        Some((self.limit.min(bursts) - 1) / stride * stride)
    }

    /// Whether it has a turn in this burst.
    pub fn runs(&self, number: usize, bursts: usize) -> bool {
        let turn = self.stride(bursts).is_some_and(|stride| number.is_multiple_of(stride));
        turn && number < self.limit
    }

    /// From what the first burst took: as many as the time cap allows.
    pub fn limit_to(&mut self, settings: &Settings) {
        let turns = (1e3 * settings.cap_s / self.spent_ms.max(1e-3)) as usize;
        let stride = self.stride(settings.bursts()).unwrap_or(1);
        self.limit = turns.max(1).saturating_mul(stride);
    }

    /// Replays a burst; `stiffness` is K after it, for those who start from that.
    pub fn burst(
        &mut self,
        number: usize,
        burst: &Burst,
        stiffness: impl FnOnce() -> Result<SparseStiffness>,
    ) -> Result<()> {
        let begin = Instant::now();
        match &mut self.runner {
            Runner::Kept(_) => self.replay(number, burst)?,
            Runner::Direct { method, solver, .. } => {
                let (fresh, time) = method.rebuild(&stiffness()?)?;
                self.split.push(number, time);
                *solver = Some(fresh);
            }
            Runner::Done => {}
        }
        self.use_it(number, burst)?;
        self.spent_ms += milliseconds_since(begin);
        Ok(())
    }

    /// The updates of a burst; the first pair, a split and its merge, finds its numbers outside of
    /// the caches and counts apart.
    fn replay(&mut self, number: usize, burst: &Burst) -> Result<()> {
        let Runner::Kept(kept) = &mut self.runner else { return Ok(()) };
        for (at, pair) in burst.pairs.iter().enumerate() {
            let old = pair[0].kind == Change::Merge;
            for update in pair {
                let start = Instant::now();
                update.apply(kept.as_mut())?;
                let time = milliseconds_since(start);
                let samples = match update.kind {
                    Change::Split => &mut self.split,
                    Change::Merge if old => &mut self.old_merge,
                    Change::Merge => &mut self.merge,
                };
                if at > 0 {
                    samples.push(number, time);
                } else if update.kind == Change::Split {
                    self.cold_split.push(number, time);
                }
            }
        }
        Ok(())
    }

    /// Solves and columns.
    fn use_it(&mut self, number: usize, burst: &Burst) -> Result<()> {
        let mut u = vec![0.0; burst.load.len()];
        for at in 0..=BURST {
            let (solve, columns) = match &self.runner {
                Runner::Kept(kept) => {
                    let start = Instant::now();
                    kept.solve(&burst.load, &mut u)?;
                    let solve = milliseconds_since(start);
                    let start = Instant::now();
                    black_box(kept.columns(&burst.tool)?);
                    (solve, milliseconds_since(start))
                }
                Runner::Direct { solver: Some(solver), .. } => {
                    (timed(|| solver.solve(&burst.load)), timed(|| solver.columns(&burst.tool)))
                }
                Runner::Direct { solver: None, .. } | Runner::Done => return Ok(()),
            };
            if at > 0 {
                self.solve.push(number, solve);
                self.columns.push(number, columns);
            }
        }
        Ok(())
    }

    /// Takes the errors and lets go of the memory: there are no more bursts.
    pub fn judge(&mut self, reference: &Reference, seed: u64) -> Result<()> {
        let trial = Trial::new(reference, SplitMix64(seed ^ 0x5bf0_3635))?;
        let [solve, columns] =
            trial.errors(&self.columns_of(&trial.tool)?, |load| self.solved(load))?;
        let (drift, rebuilds) = match &self.runner {
            Runner::Kept(kept) => {
                (Some(drift(kept.as_ref(), seed, DRIFT_COLUMNS)), Some(kept.counts().rebuilds))
            }
            _ => (None, None),
        };
        self.errors = Some(Errors { solve, columns, drift, rebuilds, reference: reference.name() });
        self.runner = Runner::Done;
        Ok(())
    }

    /// Columns of C; none where nothing is held.
    fn columns_of(&self, slots: &[usize]) -> Result<Mat<f64>> {
        match &self.runner {
            Runner::Kept(kept) => Ok(kept.columns(slots)?),
            Runner::Direct { solver: Some(solver), .. } => Ok(solver.columns(slots)),
            Runner::Direct { solver: None, .. } | Runner::Done => Ok(Mat::new()),
        }
    }

    /// C f; empty where nothing is held.
    fn solved(&self, load: &[f64]) -> Result<Vec<f64>> {
        match &self.runner {
            Runner::Kept(kept) => {
                let mut u = vec![0.0; load.len()];
                kept.solve(load, &mut u)?;
                Ok(u)
            }
            Runner::Direct { solver: Some(solver), .. } => Ok(solver.solve(load)),
            Runner::Direct { solver: None, .. } | Runner::Done => Ok(Vec::new()),
        }
    }
}
