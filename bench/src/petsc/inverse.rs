//! A factor of K by PETSc in the place of a maintainer: what a reference is checked with.

use std::sync::{Mutex, PoisonError};

use yawara_inverse_update::{
    FreshRows, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange,
    StorageError,
};
use yawara_petsc::{Matrix, Petsc, PetscError, Solver, Vector};

/// Residuals by K itself that a solution is corrected with.
const REFINEMENTS: usize = 2;

/// K, and its LDLᵀ by MUMPS, made anew after every change. Of one process.
pub(crate) struct PetscInverse {
    stiffness: SparseStiffness,
    factor: Mutex<Factor>,
}

struct Factor {
    solver: Solver,
    load: Vector,
    solution: Vector,
}

impl PetscInverse {
    /// Factors K.
    ///
    /// # Errors
    /// [`InverseError::Storage`] with what PETSc refuses.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        let factor = Mutex::new(Factor::new(&stiffness).map_err(failed)?);
        Ok(Self { stiffness, factor })
    }

    fn renew(&mut self, stiffness: SparseStiffness) -> Result<(), InverseError> {
        let factor = Factor::new(&stiffness).map_err(failed)?;
        (self.stiffness, self.factor) = (stiffness, Mutex::new(factor));
        Ok(())
    }

    fn changed<T>(
        &mut self,
        change: impl FnOnce(&mut SparseStiffness) -> Result<T, InverseError>,
    ) -> Result<T, InverseError> {
        let mut stiffness = self.stiffness.clone();
        let result = change(&mut stiffness)?;
        self.renew(stiffness)?;
        Ok(result)
    }
}

fn failed(error: PetscError) -> InverseError {
    InverseError::Storage { method: "petsc", cause: StorageError::new(error) }
}

impl Factor {
    fn new(k: &SparseStiffness) -> Result<Self, PetscError> {
        let petsc = Petsc::start()?;
        let (n, m) = (k.vertices(), k.block());
        let upper = |row: usize| k.neighbours(row).iter().filter(move |column| **column >= row);
        let room: Vec<i32> = (0..n).map(|row| upper(row).count() as i32).collect();
        let mut matrix = Matrix::half(petsc, m, &room, &vec![0; n])?;
        for row in 0..n {
            for &column in upper(row) {
                if let Some(block) = k.block_at(row, column) {
                    matrix.add_block(&[row as i32], &[column as i32], block)?;
                }
            }
        }
        matrix.assemble()?;
        let solver = Solver::factor(petsc, &matrix)?;
        let vector = || Vector::new(petsc, m, n, &[]);
        Ok(Self { solver, load: vector()?, solution: vector()? })
    }

    /// u += C f.
    fn add(&mut self, f: &[f64], u: &mut [f64]) -> Result<(), PetscError> {
        self.load.with(|load| load.copy_from_slice(f))?;
        let solved = self.solver.solve(&self.load, &mut self.solution)?;
        if !solved.is_good() {
            return Err(PetscError::NotSolved(solved.reason));
        }
        let solution = self.solution.values()?;
        u.iter_mut().zip(solution).for_each(|(u, more)| *u += more);
        Ok(())
    }
}

impl InverseMaintainer for PetscInverse {
    fn name(&self) -> &'static str {
        "petsc"
    }

    fn stiffness(&self) -> &SparseStiffness {
        &self.stiffness
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.changed(|k| k.split(change))
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.changed(|k| k.merge(slot, change))
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.changed(|k| k.change(change))
    }

    fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError> {
        self.changed(|k| k.refresh(rows))
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        u.fill(0.0);
        let mut factor = self.factor.lock().unwrap_or_else(PoisonError::into_inner);
        let mut residual = f.to_vec();
        for _ in 0..=REFINEMENTS {
            factor.add(&residual, u).map_err(failed)?;
            self.stiffness.apply(u, &mut residual)?;
            residual.iter_mut().zip(f).for_each(|(left, f)| *left = f - *left);
        }
        Ok(())
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.renew(self.stiffness.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;

    #[test]
    fn a_spring_is_solved_and_one_that_hangs_free_is_refused() {
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        k.add(&[0, 1], mat![[2.0, -2.0], [-2.0, 2.0]].as_ref()).unwrap();
        let free = PetscInverse::new(k.clone());
        let mut u = [0.0; 2];
        let refused = free.and_then(|free| free.solve(&[1.0, 0.0], &mut u)).unwrap_err();
        assert!(matches!(refused, InverseError::Storage { method: "petsc", .. }), "{refused}");
        k.add(&[0], mat![[1.0]].as_ref()).unwrap();
        PetscInverse::new(k).unwrap().solve(&[1.0, 0.5], &mut u).unwrap();
        assert!((u[0] - 1.5).abs() < 1e-12 && (u[1] - 1.75).abs() < 1e-12, "{u:?}");
    }
}
