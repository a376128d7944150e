//! What studies are asked for on the command line.

use std::path::PathBuf;

use clap::Args;

use super::race::{BURST, Settings};
use crate::cases::Selection;
use crate::direct::Direct;
use crate::error::BenchError;
use crate::machine::Machine;

/// Where a study writes, and how much of it is run.
#[derive(Args, Clone, Debug)]
pub struct Common {
    /// Where the tables and plots go: a new or empty directory.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// A part of the study that takes less than a minute; its page says which.
    #[arg(long)]
    pub quick: bool,
    /// Write into a directory that is not empty.
    #[arg(long)]
    pub force: bool,
}

/// Which of a study's cases are run, and where to.
#[derive(Args, Clone, Debug)]
pub struct CaseArguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub selection: Selection,
    /// Fewer values or steps, and less time for each; the study's page says which.
    #[arg(long)]
    pub quick: bool,
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

/// Fewer vertices than the coarsest mesh are refused when it is there; more than this its finest
/// level does not have.
const VERTICES: (usize, usize) = (8, 32_768);

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

/// Numbers of free vertices, ascending, each once; `otherwise` if none is given.
///
/// # Errors
/// [`BenchError::OutOfRange`].
pub(crate) fn sizes(given: &[usize], otherwise: &[usize]) -> Result<Vec<usize>, BenchError> {
    let mut vertices = if given.is_empty() { otherwise } else { given }.to_vec();
    vertices.iter().try_for_each(|&n| in_range("--vertices", n, VERTICES))?;
    vertices.sort_unstable();
    vertices.dedup();
    Ok(vertices)
}

/// Refuses a number that makes no sense.
///
/// # Errors
/// [`BenchError::OutOfRange`].
pub(crate) fn in_range(
    option: &'static str,
    value: usize,
    limits: (usize, usize),
) -> Result<(), BenchError> {
    if (limits.0..=limits.1).contains(&value) {
        return Ok(());
    }
    Err(BenchError::OutOfRange { option, value, limits })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_sorted_and_nonsense_is_refused() {
        assert_eq!(sizes(&[512, 300, 512], &[9]).unwrap(), [300, 512]);
        assert_eq!(sizes(&[], &[9]).unwrap(), [9]);
        for bad in [0, 7, 32_769, usize::MAX] {
            let error = sizes(&[512, bad], &[9]).unwrap_err();
            assert!(matches!(error, BenchError::OutOfRange { value, .. } if value == bad));
        }
    }
}
