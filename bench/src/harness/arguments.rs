//! Command-line arguments that studies have in common.

use std::path::PathBuf;

use clap::Args;

use crate::error::{BenchError, Result};
use crate::harness::folder::Folder;

/// Where a study writes, and how much of it is run.
#[derive(Args, Clone, Debug)]
pub struct Common {
    /// Where the tables and plots go: a new or empty directory.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write into a directory that is not empty.
    #[arg(long)]
    pub force: bool,
    /// A part of the study that takes less than a minute; its page says which.
    #[arg(long)]
    pub quick: bool,
}

impl Common {
    /// The folder, checked before anything is measured.
    /// # Errors
    /// Those of [`Folder::create`].
    pub fn folder(&self) -> Result<Folder> {
        Folder::create(&self.out, self.force)
    }
}

/// Fewer vertices than the coarsest mesh are refused when it is there; more than this its finest
/// level does not have.
const VERTICES: (usize, usize) = (8, 32_768);

/// Numbers of free vertices, ascending, each once; `otherwise` if none is given.
pub(crate) fn sizes(given: &[usize], otherwise: &[usize]) -> Result<Vec<usize>> {
    let mut vertices = if given.is_empty() { otherwise } else { given }.to_vec();
    vertices.iter().try_for_each(|&n| in_range("--vertices", n, VERTICES))?;
    vertices.sort_unstable();
    vertices.dedup();
    Ok(vertices)
}

/// Refuses a number that makes no sense.
pub(crate) fn in_range(option: &'static str, value: usize, limits: (usize, usize)) -> Result<()> {
    let is_in = (limits.0..=limits.1).contains(&value);
    if is_in { Ok(()) } else { Err(BenchError::OutOfRange { option, value, limits }) }
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
