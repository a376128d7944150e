//! What solves K u = f.

use std::ptr::null_mut;

use crate::ffi;
use crate::matrix::Matrix;
use crate::session::{Petsc, Result, call, int, locked};
use crate::vector::Vector;

/// A solver of one matrix, whose entries may change.
pub struct Solver {
    raw: ffi::Object,
}

// SAFETY: as for `Vector`.
unsafe impl Send for Solver {}

/// How a solution ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Solved {
    /// Iterations.
    pub iterations: usize,
    /// PETSc's reason, positive where it has converged.
    pub reason: i32,
}

impl Solved {
    /// Whether it has converged.
    #[must_use]
    pub fn is_good(self) -> bool {
        self.reason > 0
    }
}

impl Solver {
    /// Conjugate gradients after smoothed aggregation (GAMG), to a residual of `relative` times the load in at most so many
    /// `iterations`. Options of PETSc change all of it.
    ///
    /// # Errors
    /// [`PetscError::Call`](crate::PetscError::Call).
    pub fn multigrid(
        petsc: &Petsc,
        matrix: &Matrix,
        relative: f64,
        iterations: usize,
    ) -> Result<Self> {
        let mut solver = Self::new(petsc, matrix)?;
        solver.set_tolerance(relative, iterations)?;
        let _lock = locked();
        // SAFETY: live objects, texts that end with a zero.
        unsafe {
            call!(KSPSetType(solver.raw, c"cg".as_ptr()))?;
            call!(KSPSetNormType(solver.raw, ffi::KSP_NORM_UNPRECONDITIONED))?;
            call!(PCSetType(solver.preconditioner()?, c"gamg".as_ptr()))?;
            call!(KSPSetFromOptions(solver.raw))?;
        }
        Ok(solver)
    }

    /// LDLᵀ by MUMPS; the matrix may have pivots of either sign.
    ///
    /// # Errors
    /// [`PetscError::Call`](crate::PetscError::Call), also where it is singular.
    pub fn factor(petsc: &Petsc, matrix: &Matrix) -> Result<Self> {
        let solver = Self::new(petsc, matrix)?;
        let kind = if matrix.is_half() { c"cholesky" } else { c"lu" };
        let _lock = locked();
        // SAFETY: live objects, texts that end with a zero.
        unsafe {
            call!(KSPSetType(solver.raw, c"preonly".as_ptr()))?;
            let preconditioner = solver.preconditioner()?;
            call!(PCSetType(preconditioner, kind.as_ptr()))?;
            call!(PCFactorSetMatSolverType(preconditioner, c"mumps".as_ptr()))?;
            call!(KSPSetFromOptions(solver.raw))?;
            call!(KSPSetUp(solver.raw))?;
        }
        Ok(solver)
    }

    fn new(petsc: &Petsc, matrix: &Matrix) -> Result<Self> {
        let mut raw = null_mut();
        let lock = locked();
        // SAFETY: PETSc runs; the result goes to a live local.
        unsafe { call!(KSPCreate(petsc.world(), &raw mut raw))? };
        drop(lock);
        let solver = Self { raw };
        // The lock goes before the solver does where that fails.
        let _lock = locked();
        // SAFETY: live objects; PETSc counts references to the matrix.
        unsafe { call!(KSPSetOperators(solver.raw, matrix.raw(), matrix.raw()))? };
        Ok(solver)
    }

    /// The preconditioner, which the solver owns; the lock has to be held.
    unsafe fn preconditioner(&self) -> Result<ffi::Object> {
        let mut preconditioner = null_mut();
        // SAFETY: a live solver, a live local; our callers hold the lock.
        unsafe { call!(KSPGetPC(self.raw, &raw mut preconditioner))? };
        Ok(preconditioner)
    }

    /// Another accuracy, and another limit.
    ///
    /// # Errors
    /// [`PetscError::Call`](crate::PetscError::Call).
    pub fn set_tolerance(&mut self, relative: f64, iterations: usize) -> Result<()> {
        let most = int(iterations)?;
        let _lock = locked();
        // SAFETY: a live solver.
        unsafe { call!(KSPSetTolerances(self.raw, relative, 1e-300, 1e8, most)) }
    }

    /// Whether the preconditioner stays as it is where the matrix changes.
    ///
    /// # Errors
    /// [`PetscError::Call`](crate::PetscError::Call).
    pub fn keep_preconditioner(&mut self, is_kept: bool) -> Result<()> {
        let _lock = locked();
        // SAFETY: a live solver.
        unsafe { call!(KSPSetReusePreconditioner(self.raw, is_kept.into())) }
    }

    /// u = K⁻¹ f as well as it was asked for; whether that was reached is in what is returned.
    ///
    /// # Errors
    /// [`PetscError::Call`](crate::PetscError::Call).
    pub fn solve(&mut self, f: &Vector, u: &mut Vector) -> Result<Solved> {
        let (mut iterations, mut reason) = (0, 0);
        let _lock = locked();
        // SAFETY: live objects, of which u is ours alone; PETSc checks their lengths.
        unsafe {
            call!(KSPSolve(self.raw, f.raw(), u.raw()))?;
            call!(KSPGetIterationNumber(self.raw, &raw mut iterations))?;
            call!(KSPGetConvergedReason(self.raw, &raw mut reason))?;
        }
        Ok(Solved { iterations: iterations as usize, reason })
    }
}

impl Drop for Solver {
    fn drop(&mut self) {
        let _lock = locked();
        // SAFETY: made by this crate, and destroyed once.
        unsafe {
            ffi::KSPDestroy(&raw mut self.raw);
        }
    }
}
