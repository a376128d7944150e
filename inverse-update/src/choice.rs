//! The maintainers by their scene names, and which one suits a body.

use crate::dense::{Delayed, HostStore, Lu, Paper, Woodbury, WoodburyF32};
use crate::maintainer::InverseMaintainer;
use crate::sparse::Sparse;
use crate::two_level::TwoLevel;
use crate::{InverseError, SparseStiffness};

/// The scene names that [`build`] knows.
pub const CHOICES: &[&str] =
    &["woodbury", "woodbury_f32", "delayed", "sparse", "two_level", "paper", "lu"];

/// Free vertices from which a patch pays; a factor of fewer is made in the time that a patch takes.
const PATCH_VERTICES: usize = 150;

/// Updates in a batch from which one patch for all of them takes less than a walk through the factor for each.
const PATCH_FROM: usize = 8;

/// The maintainer that takes least time in scenes, by measurement (docs/inverse.md), given how many free vertices there are
/// at the start and how many updates may come in a batch. None is dense: that would be a little faster while there are few
/// vertices, if all columns of the inverse are read, and slower by the square of their number once there are more.
pub fn choose(vertices: usize, updates_at_once: usize) -> &'static str {
    match vertices >= PATCH_VERTICES && updates_at_once >= PATCH_FROM {
        true => "two_level",
        false => "sparse",
    }
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
    fn patches_where_many_updates_come_to_many_vertices() {
        assert_eq!(choose(20, 0), "sparse");
        assert_eq!(choose(20, 100), "sparse");
        assert_eq!(choose(400, 0), "sparse");
        assert_eq!(choose(2000, 2), "sparse");
        assert_eq!(choose(400, 60), "two_level");
        assert!([0, 200, 4000].iter().all(|&n| CHOICES.contains(&choose(n, 1))));
    }
}
