//! Distributed block matrices and their solvers, by PETSc under MPI.
//!
//! What reference solutions need and no more: vectors with ghosts, symmetric matrices of blocks, conjugate gradients
//! after algebraic multigrid (GAMG) with the rigid motions, and a sparse factor (MUMPS). `session` starts PETSc, `vector`,
//! `matrix` and `solver` wrap its objects; all unsafe code of the workspace that is not in libraries is here. To build it
//! takes nothing, to link it Debian's `libpetsc-real-dev`.
//!
//! All functions are collective: every process has to call them, in the same order.

mod ffi;
mod matrix;
mod session;
mod solver;
mod vector;

pub use matrix::Matrix;
pub use session::{Petsc, PetscError};
pub use solver::{Solved, Solver};
pub use vector::Vector;
