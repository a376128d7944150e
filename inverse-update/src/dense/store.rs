//! The storage of a dense C as the maintainer sees it: it reads only small submatrices and single
//! columns of C.

use faer::{Mat, MatRef};

use super::precision::Precision;

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

/// A dense symmetric C of n rows, with deferred terms Y Σ Yᵀ beside it.
///
/// What every method reads is C with these terms. Rows are checked by the caller. Numbers are
/// stored as [`Scalar`](Self::Scalar) and exchanged as f64. If a method fails, as for lack of
/// memory, C is as before, unless the storage itself is lost: then all later calls fail as well. The
/// provided methods are for stores that defer nothing and have no shorter way to read C.
///
/// A store of one's own that defers nothing:
///
/// ```
/// use std::convert::Infallible;
///
/// use faer::{Mat, MatRef};
/// use yawara_inverse_update::{DenseStore, Staged};
///
/// struct Full {
///     c: Mat<f64>,
///     staged: Mat<f64>,
///     signs: Vec<f64>,
/// }
///
/// impl DenseStore for Full {
///     type Scalar = f64;
///     type Error = Infallible;
///     fn method(&self) -> &'static str {
///         "full"
///     }
///     fn load(&mut self, lower: MatRef<'_, f64>) -> Result<(), Infallible> {
///         let n = lower.nrows();
///         self.c = Mat::from_fn(n, n, |i, j| lower[(i.max(j), i.min(j))]);
///         Ok(())
///     }
///     fn columns(&mut self, rows: &[usize]) -> Result<Mat<f64>, Infallible> {
///         Ok(Mat::from_fn(self.c.nrows(), rows.len(), |i, j| self.c[(i, rows[j])]))
///     }
///     fn multiply(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, Infallible> {
///         Ok(&self.c * x)
///     }
///     fn stage(&mut self, update: &Staged<'_>) -> Result<Vec<f64>, Infallible> {
///         self.staged = self.product(update.rows, update.x)?;
///         update.plus.into_iter().for_each(|plus| self.staged += plus);
///         self.signs = update.signs.to_vec();
///         let term = |i, (k, sign): (usize, &f64)| sign * self.staged[(i, k)].powi(2);
///         let terms = |i| self.signs.iter().enumerate().map(|each| term(i, each)).sum::<f64>();
///         Ok((0..self.c.nrows()).map(|i| self.c[(i, i)] + terms(i)).collect())
///     }
///     fn accept(&mut self, own: MatRef<'_, f64>) -> Result<(), Infallible> {
///         let (n, k) = (self.c.nrows(), self.signs.len());
///         let (y, border) = self.staged.split_at_col(k);
///         let signed = Mat::from_fn(n, k, |i, j| y[(i, j)] * self.signs[j]);
///         let c = &self.c + signed * y.transpose();
///         let all = n + own.nrows();
///         self.c = Mat::from_fn(all, all, |i, j| match (i.max(j), i.min(j)) {
///             (row, _) if row < n => c[(i, j)],
///             (row, column) if column < n => border[(column, row - n)],
///             (row, column) => own[(row - n, column - n)],
///         });
///         Ok(())
///     }
///     fn remove(&mut self, slot: usize, block: usize) -> Result<(), Infallible> {
///         let (first, kept) = (block * slot, self.c.nrows() - block);
///         let old = |i| if (first..first + block).contains(&i) { i - first + kept } else { i };
///         self.c = Mat::from_fn(kept, kept, |i, j| self.c[(old(i), old(j))]);
///         Ok(())
///     }
/// }
///
/// // A spring of 2 N/m to the wall; then a vertex on a spring of 3 N/m behind it.
/// use faer::mat;
/// use yawara_inverse_update::{
///     Delayed, InverseError, InverseMaintainer, RingChange, SparseStiffness,
/// };
/// let mut stiffness = SparseStiffness::zeros(1, 1)?;
/// stiffness.add(&[0], mat![[5.0]].as_ref())?;
/// let empty = Full { c: Mat::zeros(0, 0), staged: Mat::zeros(0, 0), signs: vec![] };
/// let mut inverse = Delayed::new(stiffness, empty)?;
/// inverse.split(&RingChange::freed(vec![0], mat![[-3.0]], mat![[3.0]], 0)?)?;
/// let mut u = [0.0; 2];
/// inverse.solve(&[0.0, 6.0], &mut u)?;
/// assert!((u[0] - 3.0).abs() < 1e-12 && (u[1] - 5.0).abs() < 1e-12);
/// # Ok::<(), InverseError>(())
/// ```
/// # Source
/// McDaniel et al., Delayed Slater determinant update algorithms, J. Chem. Phys. 147, 2017.
pub trait DenseStore: Send {
    /// What a number of C is stored as; it decides whether solutions are refined.
    type Scalar: Precision;

    /// What can go wrong; the maintainer returns it inside
    /// [`InverseError::Storage`](crate::InverseError::Storage).
    type Error: std::error::Error + Send + Sync + 'static;

    /// Scene name of the maintainer on this storage.
    fn method(&self) -> &'static str;

    /// Where C is stored, if not in the host's memory: the device, and the memory used there.
    fn place(&self) -> Option<String> {
        None
    }

    /// Takes the lower triangle of a square matrix, rounded, with nothing deferred. Cost: O(n²).
    fn load(&mut self, lower: MatRef<'_, f64>) -> Result<(), Self::Error>;

    /// Deferred columns.
    fn delayed(&self) -> usize {
        0
    }

    /// C_rr, r × r. Cost: as the columns of r.
    fn submatrix(&mut self, rows: &[usize]) -> Result<Mat<f64>, Self::Error> {
        let columns = self.columns(rows)?;
        Ok(Mat::from_fn(rows.len(), rows.len(), |i, j| columns[(rows[i], j)]))
    }

    /// C_:r, n × r. Cost: O(n r).
    fn columns(&mut self, rows: &[usize]) -> Result<Mat<f64>, Self::Error>;

    /// C_:r X, n × k, for X of r × k. Cost: O(n r k).
    fn product(&mut self, rows: &[usize], x: MatRef<'_, f64>) -> Result<Mat<f64>, Self::Error> {
        Ok(self.columns(rows)? * x)
    }

    /// C X, n × k. Cost: O(n² k).
    fn multiply(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, Self::Error>;

    /// Computes the columns of an update and returns the diagonal of C + Y Σ Yᵀ, n numbers; C stays
    /// as it is. Cost: O(n r (k + m)).
    fn stage(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, Self::Error>;

    /// Defers the staged Y Σ Yᵀ and appends the other m staged columns as rows, with the corner
    /// `own`, m × m. Nothing else may come between this and [`stage`](Self::stage).
    fn accept(&mut self, own: MatRef<'_, f64>) -> Result<(), Self::Error>;

    /// Removes the rows and columns of a slot of `block` rows; the last slot's move into the gap.
    fn remove(&mut self, slot: usize, block: usize) -> Result<(), Self::Error>;

    /// Adds the deferred terms to C: one pass. Cost: O(n² k).
    fn fold(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}
