//! What references are solved by.

use std::cell::Cell;

use clap::ValueEnum;
use serde::Serialize;
use yawara::InverseFactory;
use yawara_inverse_update::{InverseError, InverseMaintainer, SparseStiffness, build};

use crate::error::{BenchError, Result};
#[cfg(feature = "petsc")]
use crate::harness::ranks;

/// What solves for what others are measured against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceBy {
    /// This project's own factor.
    #[default]
    BuiltIn,
    /// MUMPS by PETSc (needs the feature `petsc`).
    Petsc,
}

thread_local! {
    static NOW: Cell<ReferenceBy> = const { Cell::new(ReferenceBy::BuiltIn) };
}

impl ReferenceBy {
    /// Whether this program has it.
    /// # Errors
    /// [`BenchError::FeatureMissing`].
    pub(crate) fn check(self) -> Result<()> {
        match self == Self::Petsc && cfg!(not(feature = "petsc")) {
            true => Err(BenchError::FeatureMissing("--reference petsc", "petsc")),
            false => Ok(()),
        }
    }

    /// What makes inverses: `own` where it is built in.
    /// # Errors
    /// Those of [`check`](Self::check); [`BenchError::OneReference`] in several processes.
    pub(crate) fn factory(self, own: InverseFactory) -> Result<InverseFactory> {
        self.check()?;
        match self {
            #[cfg(feature = "petsc")]
            Self::Petsc => match ranks::started() {
                0 | 1 => Ok(Box::new(|k| Ok(Box::new(crate::petsc::PetscInverse::new(k)?)))),
                processes => Err(BenchError::OneReference(processes)),
            },
            _ => Ok(own),
        }
    }

    /// Has all that `work` solves at rest in this thread be solved by it.
    pub(crate) fn solve<T>(self, work: impl FnOnce() -> T) -> T {
        let before = NOW.replace(self);
        let result = work();
        NOW.set(before);
        result
    }
}

/// The inverse that bodies at rest are solved by, as [`ReferenceBy::solve`] says.
/// # Errors
/// Those of [`ReferenceBy::factory`], [`BenchError::Inverse`].
pub(crate) fn inverse_at_rest(k: SparseStiffness) -> Result<Box<dyn InverseMaintainer>> {
    let own = |k| -> Result<_, InverseError> { build("sparse", k) };
    Ok(NOW.get().factory(Box::new(own))?(k)?)
}
