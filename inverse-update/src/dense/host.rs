//! The host's memory as the place of a dense C, in f64.

use std::convert::Infallible;

use faer::{Mat, MatRef};

use super::store::{DenseStore, Staged};
use super::tiles::{Deferred, Panel, SignedPanel};

/// Packed tiles in the host's memory, with the deferred columns beside them.
#[derive(Debug, Default)]
pub struct HostStore {
    inverse: Deferred<f64>,
    /// Y and its signs.
    staged: SignedPanel,
    /// Rows to be appended.
    border: Panel,
}

impl HostStore {
    /// Holds a C of no rows.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}

impl DenseStore for HostStore {
    type Scalar = f64;
    type Error = Infallible;

    fn method(&self) -> &'static str {
        "delayed"
    }

    fn load(&mut self, lower: MatRef<'_, f64>) -> Result<(), Infallible> {
        self.inverse = Deferred::from_lower(lower);
        self.staged = SignedPanel::none(lower.nrows());
        Ok(())
    }

    fn delayed(&self) -> usize {
        self.inverse.pending()
    }

    fn submatrix(&mut self, rows: &[usize]) -> Result<Mat<f64>, Infallible> {
        Ok(self.inverse.submatrix(rows))
    }

    fn columns(&mut self, rows: &[usize]) -> Result<Mat<f64>, Infallible> {
        Ok(self.inverse.gather(rows))
    }

    fn product(&mut self, rows: &[usize], x: MatRef<'_, f64>) -> Result<Mat<f64>, Infallible> {
        Ok(self.inverse.select_times(rows, x).to_matrix())
    }

    fn multiply(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, Infallible> {
        Ok(self.inverse.multiply(&Panel::from_matrix(x)).to_matrix())
    }

    fn stage(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, Infallible> {
        let (k, all) = (staged.signs.len(), staged.x.ncols());
        let mut columns = self.inverse.select_times(staged.rows, staged.x);
        if let Some(plus) = staged.plus {
            let one = Mat::<f64>::identity(all, all);
            columns.add_times(&Panel::from_matrix(plus), one.as_ref());
        }
        self.border = columns.some_columns(k..all);
        let columns = columns.some_columns(0..k);
        self.staged = SignedPanel { columns, signs: staged.signs.to_vec() };
        Ok(self.inverse.diagonal_with(&self.staged))
    }

    fn accept(&mut self, own: MatRef<'_, f64>) -> Result<(), Infallible> {
        self.inverse.defer(std::mem::take(&mut self.staged));
        self.inverse.append(&self.border, own);
        Ok(())
    }

    fn remove(&mut self, slot: usize, block: usize) -> Result<(), Infallible> {
        self.inverse.swap_remove(slot, block);
        Ok(())
    }

    fn fold(&mut self) -> Result<(), Infallible> {
        self.inverse.flush();
        Ok(())
    }
}
