//! The maintainers by their scene names, and which one suits a body.

use crate::dense::{Delayed, HostStore, Lu, Paper, Woodbury, WoodburyF32};
use crate::maintainer::InverseMaintainer;
use crate::sparse::Sparse;
use crate::two_level::TwoLevel;
use crate::{InverseError, SparseStiffness};

/// The scene names that [`build`] knows, the default first.
pub const CHOICES: &[&str] =
    &["woodbury", "woodbury_f32", "delayed", "sparse", "two_level", "paper", "lu"];

/// Free vertices from which `sparse` beats a dense inverse at everything but reading columns.
const SPARSE_FROM: usize = 150;

/// Free vertices up to which a dense inverse wins where each update is followed by reading columns
/// of at least [`MANY_COLUMNS`] vertices in full.
const DENSE_TO: usize = 450;

/// See [`DENSE_TO`].
const MANY_COLUMNS: usize = 3;

/// The maintainer that takes least time for a split with a solve, by measurement (the crossings
/// in the study `table1`), given how many free vertices there are and of how many of them full
/// columns are read after each update.
pub fn choose(vertices: usize, columns_per_update: usize) -> &'static str {
    let reads_many = columns_per_update >= MANY_COLUMNS && vertices <= DENSE_TO;
    if vertices < SPARSE_FROM || reads_many { "woodbury" } else { "sparse" }
}

/// Makes the maintainer of that name and inverts `stiffness`. Cost: O(n³), O(n²) for `sparse` and `two_level`.
/// # Errors
/// [`InverseError::Unknown`] if `name` is not one of [`CHOICES`]; [`InverseError::Singular`] if
/// `stiffness` is not positive definite (a part of the body hangs free), or not quasi-definite as
/// it announces; [`InverseError::BlockTooLarge`].
pub fn build(
    name: &str,
    stiffness: SparseStiffness,
) -> Result<Box<dyn InverseMaintainer>, InverseError> {
    match name {
        "woodbury" => Ok(Box::new(Woodbury::new(stiffness)?)),
        "woodbury_f32" => Ok(Box::new(WoodburyF32::new(stiffness)?)),
        "delayed" => Ok(Box::new(Delayed::new(stiffness, HostStore::new())?)),
        "sparse" => Ok(Box::new(Sparse::new(stiffness)?)),
        "two_level" => Ok(Box::new(TwoLevel::new(stiffness)?)),
        "paper" => Ok(Box::new(Paper::new(stiffness)?)),
        "lu" => Ok(Box::new(Lu::new(stiffness)?)),
        _ => Err(InverseError::Unknown { name: name.to_owned(), choices: CHOICES }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dense_where_it_is_small_or_its_columns_are_read() {
        assert_eq!(choose(20, 0), "woodbury");
        assert_eq!(choose(400, 0), "sparse");
        assert_eq!(choose(400, 9), "woodbury");
        assert_eq!(choose(600, 9), "sparse");
        assert_eq!(choose(2000, 9), "sparse");
        assert!([0, 200, 4000].iter().all(|&n| CHOICES.contains(&choose(n, 1))));
    }
}
