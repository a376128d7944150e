//! Vectors of blocks, each process with its own and copies of some of the others'.

use std::ptr::{null, null_mut};

use crate::ffi;
use crate::session::{Petsc, PetscError, Result, call, int, locked};

/// A vector in parts, one for each process; blocks of some others are known as ghosts.
pub struct Vector {
    raw: ffi::Object,
    block: usize,
    owned: usize,
    ghosts: usize,
}

// SAFETY: PETSc ties no object to a thread, there is no `Sync`, and all calls hold the lock.
unsafe impl Send for Vector {}

impl Vector {
    /// Zeros: `owned` blocks of `block` numbers here, and copies of those with the numbers `ghosts`, which others own.
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn new(petsc: &Petsc, block: usize, owned: usize, ghosts: &[i32]) -> Result<Self> {
        let mut raw = null_mut();
        let (m, rows, count) = (int(block)?, int(block * owned)?, int(ghosts.len())?);
        let _lock = locked();
        // SAFETY: PETSc runs; it copies the numbers, which it checks, and the result goes to a live local.
        unsafe {
            let (comm, at) = (petsc.world(), &raw mut raw);
            call!(VecCreateGhostBlock(comm, m, rows, ffi::DETERMINE, count, ghosts.as_ptr(), at))?;
        }
        Ok(Self { raw, block, owned, ghosts: ghosts.len() })
    }

    pub(crate) fn raw(&self) -> ffi::Object {
        self.raw
    }

    /// Numbers per block.
    #[must_use]
    pub fn block(&self) -> usize {
        self.block
    }

    /// Has `work` read and write the numbers that are here, those owned first, then the ghosts.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn with<T>(&mut self, work: impl FnOnce(&mut [f64]) -> T) -> Result<T> {
        let (mut local, mut values) = (null_mut(), null_mut());
        let length = self.block * (self.owned + self.ghosts);
        let lock = locked();
        // SAFETY: a live vector, live locals.
        unsafe {
            call!(VecGhostGetLocalForm(self.raw, &raw mut local))?;
            call!(VecGetArray(local, &raw mut values))?;
        }
        // `work` may want other vectors.
        drop(lock);
        let result = match length {
            0 => work(&mut []),
            // SAFETY: the local form has as many numbers as owned blocks and ghosts have together, and they are ours
            // alone until they are given back, since `self` is.
            _ => work(unsafe { std::slice::from_raw_parts_mut(values, length) }),
        };
        let _lock = locked();
        // SAFETY: what was taken above.
        unsafe {
            call!(VecRestoreArray(local, &raw mut values))?;
            call!(VecGhostRestoreLocalForm(self.raw, &raw mut local))?;
        }
        Ok(result)
    }

    /// A copy of the numbers that are here, those owned first, then the ghosts.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn values(&self) -> Result<Vec<f64>> {
        let (mut local, mut values) = (null_mut(), null());
        let length = self.block * (self.owned + self.ghosts);
        let _lock = locked();
        // SAFETY: a live vector, live locals; the local form has so many numbers, which nobody writes to while the lock
        // is held and `self` is borrowed, and they are copied before they are given back.
        unsafe {
            call!(VecGhostGetLocalForm(self.raw, &raw mut local))?;
            call!(VecGetArrayRead(local, &raw mut values))?;
            let copy = match length {
                0 => Vec::new(),
                _ => std::slice::from_raw_parts(values, length).to_vec(),
            };
            call!(VecRestoreArrayRead(local, &raw mut values))?;
            call!(VecGhostRestoreLocalForm(self.raw, &raw mut local))?;
            Ok(copy)
        }
    }

    /// Takes the owners' numbers for the ghosts.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn update_ghosts(&mut self) -> Result<()> {
        self.exchange(ffi::INSERT_VALUES, ffi::SCATTER_FORWARD)
    }

    /// Adds the ghosts to the owners' numbers.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn add_ghosts(&mut self) -> Result<()> {
        self.exchange(ffi::ADD_VALUES, ffi::SCATTER_REVERSE)
    }

    fn exchange(&mut self, insert: i32, scatter: i32) -> Result<()> {
        let _lock = locked();
        // SAFETY: a live vector with ghosts.
        unsafe {
            call!(VecGhostUpdateBegin(self.raw, insert, scatter))?;
            call!(VecGhostUpdateEnd(self.raw, insert, scatter))
        }
    }

    /// √Σx² over all processes.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn norm(&self) -> Result<f64> {
        let mut norm = 0.0;
        let _lock = locked();
        // SAFETY: a live vector, a live local.
        unsafe { call!(VecNorm(self.raw, ffi::NORM_2, &raw mut norm))? };
        Ok(norm)
    }

    /// The largest number of all processes.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn max(&self) -> Result<f64> {
        let mut max = 0.0;
        let _lock = locked();
        // SAFETY: a live vector, a live local, and null for the place, which is not asked for.
        unsafe { call!(VecMax(self.raw, null_mut(), &raw mut max))? };
        Ok(max)
    }

    /// Σx over all processes.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn sum(&self) -> Result<f64> {
        let mut sum = 0.0;
        let _lock = locked();
        // SAFETY: a live vector, a live local.
        unsafe { call!(VecSum(self.raw, &raw mut sum))? };
        Ok(sum)
    }

    /// Σxy over all processes.
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn dot(&self, other: &Self) -> Result<f64> {
        if (self.block, self.owned) != (other.block, other.owned) {
            let (want, got) = (self.block * self.owned, other.block * other.owned);
            return Err(PetscError::Length { what: "the other vector", want, got });
        }
        let mut dot = 0.0;
        let _lock = locked();
        // SAFETY: live vectors of one length, a live local.
        unsafe { call!(VecDot(self.raw, other.raw, &raw mut dot))? };
        Ok(dot)
    }
}

impl Drop for Vector {
    fn drop(&mut self) {
        let _lock = locked();
        // SAFETY: made by this crate, and destroyed once. There is nobody to tell of an error.
        unsafe {
            ffi::VecDestroy(&raw mut self.raw);
        }
    }
}
