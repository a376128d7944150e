//! Reference solutions by PETSc: of a body as its finest tetrahedra, shared out among the processes of mpirun, and of
//! any scene's stiffness.
//!
//! `numbering` says which process has which vertex, `body` is one process's part of the finest tetrahedra and finds
//! where all of them come to rest, `inverse` is a factor of K in the place of a maintainer.

mod body;
mod inverse;
mod numbering;

pub(crate) use body::{Body, Problem, sum_of};
pub(crate) use inverse::PetscInverse;
