//! Where a dense C lies, seen from the maintainer that updates it: only small blocks and single
//! columns of C ever come back.

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::stored::Stored;

/// Columns that an update computes from C, kept aside until they are accepted or replaced.
#[derive(Debug, Clone, Copy)]
pub struct Staged<'a> {
    /// The rows r of C that the columns are made of.
    pub rows: &'a [usize],
    /// X, r × (k + m): the columns are C_:r X.
    pub x: MatRef<'a, f64>,
    /// Columns to be added to them, n × (k + m), for those that were computed elsewhere.
    pub plus: Option<MatRef<'a, f64>>,
    /// Σ: the signs ±1 of the first k columns Y in C + Y Σ Yᵀ. The last m are rows to be appended.
    pub signs: &'a [f64],
}

/// A dense symmetric C of n rows, with the terms Y Σ Yᵀ that are put off beside it.
///
/// What every method reads is C with these terms. Rows are checked by the caller. Numbers are
/// stored as [`Scalar`](Self::Scalar) and exchanged as f64. If a method fails, C is as before,
/// unless the storage itself is lost: then all later calls fail as well.
/// # Source
/// McDaniel et al., Delayed Slater determinant update algorithms, J. Chem. Phys. 147, 2017.
pub trait DenseStore: Send {
    /// What a number of C is stored as; it decides whether solutions are refined.
    type Scalar: Stored;

    /// Scene name of the maintainer on this storage.
    fn method(&self) -> &'static str;

    /// Where C lies, if not in the host's memory: which device and what it takes there.
    fn place(&self) -> Option<String> {
        None
    }

    /// Whether every answer has to be waited for, so that updates had better come together.
    fn is_remote(&self) -> bool {
        false
    }

    /// Takes the lower triangle of a square matrix, rounded, with nothing put off. Cost: O(n²).
    ///
    /// # Errors
    /// [`InverseError::Storage`], as all methods here, if there is no room or the storage is lost.
    fn load(&mut self, lower: MatRef<'_, f64>) -> Result<(), InverseError>;

    /// Columns put off.
    fn delayed(&self) -> usize;

    /// C_rr, r × r. Cost: as the columns of r.
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn block(&mut self, rows: &[usize]) -> Result<Mat<f64>, InverseError>;

    /// C_:r, n × r. Cost: O(n r).
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn columns(&mut self, rows: &[usize]) -> Result<Mat<f64>, InverseError>;

    /// C_:r X, n × k, for X of r × k. Cost: O(n r k).
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn product(&mut self, rows: &[usize], x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>;

    /// C X, n × k. Cost: O(n² k).
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn multiply(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>;

    /// Computes the columns of an update and returns the diagonal of C + Y Σ Yᵀ, n numbers; C stays
    /// as it is. Cost: O(n r (k + m)).
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn stage(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, InverseError>;

    /// Puts off the staged Y Σ Yᵀ and appends the other m staged columns as rows, with the corner
    /// `own`, m × m. Nothing else may come between this and [`stage`](Self::stage).
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn accept(&mut self, own: MatRef<'_, f64>) -> Result<(), InverseError>;

    /// Removes the rows and columns of a slot of `block` rows; the last slot's move into the gap.
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn remove(&mut self, slot: usize, block: usize) -> Result<(), InverseError>;

    /// Adds what is put off to C: one pass. Cost: O(n² k).
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    fn fold(&mut self) -> Result<(), InverseError>;
}
