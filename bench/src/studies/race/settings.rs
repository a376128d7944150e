//! What a race is asked for: sizes, families of rings, methods, limits.

use clap::Args;
use serde::Serialize;
use yawara_inverse_update::CHOICES;

use crate::error::Result;
use crate::harness::arguments::{Common, in_range, sizes};
use crate::harness::machine::Machine;
use crate::solvers::direct::{DIRECT, Direct};

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
    /// Bursts that all pairs make.
    pub fn bursts(&self) -> usize {
        self.pairs.div_ceil(BURST)
    }
}

/// Sizes, limits and where to write.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub common: Common,
    /// Numbers of free vertices, separated by commas.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub vertices: Vec<usize>,
    /// Pairs of a split and a merge that are timed at each size.
    #[arg(long, value_name = "N")]
    pub pairs: Option<usize>,
    /// Seconds that one method may take at one size; what would take longer once is extrapolated
    /// or left out.
    #[arg(long, value_name = "S", default_value_t = 60)]
    pub cap_s: usize,
    /// Memory that one method may take, in 10⁹ bytes; a quarter of what is free by default.
    #[arg(long, value_name = "GB")]
    pub memory_gb: Option<usize>,
    /// Picks the meshes, the places and the loads.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// What a study takes where nothing is asked for: with and without `--quick`.
pub(crate) struct Defaults {
    pub vertices: [&'static [usize]; 2],
    pub pairs: [usize; 2],
    pub direct: &'static [Direct],
}

/// Fewer pairs have no median, more take a day.
const PAIRS: (usize, usize) = (BURST, 1_000_000);

/// Up to a day.
const SECONDS: (usize, usize) = (1, 86_400);

/// Up to the largest machines.
const GIGABYTES: (usize, usize) = (1, 100_000);

/// Bytes taken for free where the system does not tell.
const MEMORY: u64 = 8 << 30;

impl Arguments {
    /// Checks all numbers and fills in the defaults.
    pub(crate) fn settings(&self, defaults: &Defaults, machine: &Machine) -> Result<Settings> {
        let quick = usize::from(self.common.quick);
        let vertices = sizes(&self.vertices, defaults.vertices[quick])?;
        let pairs = self.pairs.unwrap_or(defaults.pairs[quick]);
        in_range("--pairs", pairs, PAIRS)?;
        in_range("--cap-s", self.cap_s, SECONDS)?;
        let mut memory_bytes = machine.memory_available.unwrap_or(MEMORY) as f64 / 4.0;
        if let Some(gigabytes) = self.memory_gb {
            in_range("--memory-gb", gigabytes, GIGABYTES)?;
            memory_bytes = gigabytes as f64 * 1e9;
        }
        let (direct, seed) = (defaults.direct, self.seed);
        Ok(Settings { vertices, direct, pairs, cap_s: self.cap_s as f64, memory_bytes, seed })
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

/// Names of [`CHOICES`] that are updated: the others are direct methods by themselves.
pub(crate) fn maintainers() -> impl Iterator<Item = &'static str> {
    CHOICES.iter().copied().filter(|name| DIRECT.iter().all(|direct| direct.name() != *name))
}

/// True for methods that don't hold n² numbers.
pub(crate) fn is_sparse(name: &str) -> bool {
    name.starts_with("sparse") || name == "two_level"
}
