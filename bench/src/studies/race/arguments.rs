//! Command-line arguments of the studies over many sizes.

use clap::Args;

use super::settings::{BURST, Settings};
use crate::error::BenchError;
use crate::harness::arguments::{Common, in_range, sizes};
use crate::harness::machine::Machine;
use crate::solvers::direct::Direct;

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
    ///
    /// # Errors
    /// [`BenchError::OutOfRange`].
    pub(crate) fn settings(
        &self,
        defaults: &Defaults,
        machine: &Machine,
    ) -> Result<Settings, BenchError> {
        let quick = usize::from(self.common.quick);
        let vertices = sizes(&self.vertices, defaults.vertices[quick])?;
        let pairs = self.pairs.unwrap_or(defaults.pairs[quick]);
        in_range("--pairs", pairs, PAIRS)?;
        in_range("--cap-s", self.cap_s, SECONDS)?;
        let free = machine.memory_available.unwrap_or(MEMORY) as f64 / 4.0;
        let memory_bytes = match self.memory_gb {
            Some(gigabytes) => {
                in_range("--memory-gb", gigabytes, GIGABYTES)?;
                gigabytes as f64 * 1e9
            }
            None => free,
        };
        let (direct, seed) = (defaults.direct, self.seed);
        Ok(Settings { vertices, direct, pairs, cap_s: self.cap_s as f64, memory_bytes, seed })
    }
}
