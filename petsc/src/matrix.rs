//! Symmetric matrices of blocks, in rows by process.

use std::ptr::null_mut;

use crate::ffi;
use crate::session::{Petsc, PetscError, Result, call, int, locked};
use crate::vector::Vector;

/// A symmetric matrix of square blocks, its block rows shared out among the processes.
pub struct Matrix {
    raw: ffi::Object,
    block: usize,
    is_half: bool,
}

// SAFETY: as for `Vector`.
unsafe impl Send for Matrix {}

impl Matrix {
    /// Zeros, positive definite in the end: AIJ with the block size, since the multigrid of PETSc 3.18 takes no BAIJ.
    /// `own` and `others` say how many blocks each owned row has in columns that are owned here, and in those that are not.
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn definite(petsc: &Petsc, block: usize, own: &[i32], others: &[i32]) -> Result<Self> {
        let matrix = Self::made(petsc, block, [own, others], false)?;
        let _lock = locked();
        // SAFETY: a live matrix.
        unsafe {
            call!(MatSetOption(matrix.raw, ffi::MAT_SYMMETRIC, 1))?;
            call!(MatSetOption(matrix.raw, ffi::MAT_SPD, 1))?;
        }
        Ok(matrix)
    }

    /// Zeros (SBAIJ), of which the blocks on and above the diagonal are kept: for a factor. Rows as for
    /// [`definite`](Self::definite).
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn half(petsc: &Petsc, block: usize, own: &[i32], others: &[i32]) -> Result<Self> {
        Self::made(petsc, block, [own, others], true)
    }

    fn made(
        petsc: &Petsc,
        block: usize,
        [own, others]: [&[i32]; 2],
        is_half: bool,
    ) -> Result<Self> {
        if own.len() != others.len() {
            let (want, got) = (own.len(), others.len());
            return Err(PetscError::Length { what: "room in others' columns", want, got });
        }
        let mut raw = null_mut();
        let (m, rows, all) = (int(block)?, int(block * own.len())?, ffi::DETERMINE);
        let lock = locked();
        // SAFETY: PETSc runs; the result goes to a live local.
        unsafe { call!(MatCreate(petsc.world(), &raw mut raw))? };
        drop(lock);
        let matrix = Self { raw, block, is_half };
        // The lock goes before the matrix does where something fails.
        let _lock = locked();
        let (kind, own, others) =
            (if is_half { c"sbaij" } else { c"aij" }, own.as_ptr(), others.as_ptr());
        // SAFETY: a live matrix; both lists have a number for each owned block row, and are read only here.
        unsafe {
            call!(MatSetSizes(raw, rows, rows, all, all))?;
            call!(MatSetBlockSize(raw, m))?;
            call!(MatSetType(raw, kind.as_ptr()))?;
            call!(MatXAIJSetPreallocation(raw, m, own, others, own, others))?;
        }
        Ok(matrix)
    }

    pub(crate) fn raw(&self) -> ffi::Object {
        self.raw
    }

    pub(crate) fn is_half(&self) -> bool {
        self.is_half
    }

    /// Adds a dense matrix, row by row, to the block rows and columns `at`, whoever owns them.
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn add(&mut self, at: &[i32], values: &[f64]) -> Result<()> {
        self.add_block(at, at, values)
    }

    /// The same in block rows `rows` and block columns `columns`.
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn add_block(&mut self, rows: &[i32], columns: &[i32], values: &[f64]) -> Result<()> {
        let want = self.block * self.block * rows.len() * columns.len();
        if values.len() != want {
            let got = values.len();
            return Err(PetscError::Length { what: "values of a matrix", want, got });
        }
        let (count, across) = (int(rows.len())?, int(columns.len())?);
        let _lock = locked();
        // SAFETY: a live matrix; as many values as PETSc reads, which checks the numbers of rows and columns.
        unsafe {
            let (row, column, values) = (rows.as_ptr(), columns.as_ptr(), values.as_ptr());
            call!(MatSetValuesBlocked(
                self.raw,
                count,
                row,
                across,
                column,
                values,
                ffi::ADD_VALUES
            ))
        }
    }

    /// Makes all entries zero; there is room where there were some.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn clear(&mut self) -> Result<()> {
        let _lock = locked();
        // SAFETY: a live matrix.
        unsafe { call!(MatZeroEntries(self.raw)) }
    }

    /// Ends additions: what others own goes to them.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn assemble(&mut self) -> Result<()> {
        let _lock = locked();
        // SAFETY: a live matrix.
        unsafe {
            call!(MatAssemblyBegin(self.raw, ffi::MAT_FINAL_ASSEMBLY))?;
            call!(MatAssemblyEnd(self.raw, ffi::MAT_FINAL_ASSEMBLY))
        }
    }

    /// Tells multigrid where the vertices are, three coordinates each: what hardly costs energy are rigid motions.
    ///
    /// # Errors
    /// [`PetscError`] if the vector has no blocks of three.
    pub fn set_positions(&mut self, positions: &Vector) -> Result<()> {
        if positions.block() != 3 {
            let got = positions.block();
            return Err(PetscError::Length { what: "coordinates of a vertex", want: 3, got });
        }
        let mut space = null_mut();
        let _lock = locked();
        // SAFETY: live objects; the matrix keeps a reference of its own to the space, ours is given up.
        unsafe {
            call!(MatNullSpaceCreateRigidBody(positions.raw(), &raw mut space))?;
            call!(MatSetNearNullSpace(self.raw, space))?;
            call!(MatNullSpaceDestroy(&raw mut space))
        }
    }
}

impl Drop for Matrix {
    fn drop(&mut self) {
        let _lock = locked();
        // SAFETY: made by this crate, and destroyed once; solvers keep references of their own.
        unsafe {
            ffi::MatDestroy(&raw mut self.raw);
        }
    }
}
