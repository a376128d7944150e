//! The host's memory as the place of a dense C, in f64.

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::dense_store::{DenseStore, Staged};
use crate::panel::Panel;
use crate::tiles::{SignedPanel, Tiles};

/// Packed tiles in the host's memory, with the columns put off beside them.
#[derive(Debug)]
pub struct HostStore {
    tiles: Tiles<f64>,
    /// What C lacks.
    pending: SignedPanel,
    /// Y and its signs.
    staged: SignedPanel,
    /// Rows to be appended.
    border: Panel,
}

impl HostStore {
    /// Holds a C of no rows.
    #[must_use]
    pub fn new() -> Self {
        let nothing = Mat::<f64>::zeros(0, 0);
        Self {
            tiles: Tiles::from_lower(nothing.as_ref()),
            pending: SignedPanel::none(0),
            staged: SignedPanel::none(0),
            border: Panel::zeros(0, 0),
        }
    }

    fn rows(&self) -> usize {
        self.tiles.diagonal().len()
    }

    /// C_:r X.
    fn select_times(&self, rows: &[usize], x: MatRef<'_, f64>) -> Panel {
        let mut product = self.tiles.select_times(rows, x);
        let at = self.pending.columns.at_rows(rows);
        product.add_times(&self.pending.signed(), (at.transpose() * x).as_ref());
        product
    }
}

impl Default for HostStore {
    fn default() -> Self {
        Self::new()
    }
}

impl DenseStore for HostStore {
    type Scalar = f64;

    fn method(&self) -> &'static str {
        "delayed"
    }

    fn load(&mut self, lower: MatRef<'_, f64>) -> Result<(), InverseError> {
        self.tiles = Tiles::from_lower(lower);
        self.pending = SignedPanel::none(lower.nrows());
        self.staged = SignedPanel::none(lower.nrows());
        Ok(())
    }

    fn delayed(&self) -> usize {
        self.pending.signs.len()
    }

    fn block(&mut self, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        let at = self.pending.columns.at_rows(rows);
        let signs = &self.pending.signs;
        let mut block = self.tiles.block(rows);
        block +=
            Mat::from_fn(at.nrows(), at.ncols(), |i, k| signs[k] * at[(i, k)]) * at.transpose();
        Ok(block)
    }

    fn columns(&mut self, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        let mut columns = self.tiles.gather(rows);
        let signed = self.pending.signed();
        let at = self.pending.columns.at_rows(rows);
        let mut correction = Panel::zeros(signed.rows(), rows.len());
        correction.add_times(&signed, at.transpose());
        columns += correction.to_matrix();
        Ok(columns)
    }

    fn product(&mut self, rows: &[usize], x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        Ok(self.select_times(rows, x).to_matrix())
    }

    fn multiply(&mut self, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        let x = Panel::from_matrix(x);
        let mut product = self.tiles.multiply(&x);
        let inner = self.pending.columns.inner(&x);
        product.add_times(&self.pending.signed(), inner.as_ref());
        Ok(product.to_matrix())
    }

    fn stage(&mut self, staged: &Staged<'_>) -> Result<Vec<f64>, InverseError> {
        let (k, all) = (staged.signs.len(), staged.x.ncols());
        let mut columns = self.select_times(staged.rows, staged.x);
        if let Some(plus) = staged.plus {
            let one = Mat::<f64>::identity(all, all);
            columns.add_times(&Panel::from_matrix(plus), one.as_ref());
        }
        self.border = columns.some_columns(k..all);
        let columns = columns.some_columns(0..k);
        self.staged = SignedPanel { columns, signs: staged.signs.to_vec() };
        let more = self.pending.diagonal().into_iter().zip(self.staged.diagonal());
        Ok(self.tiles.diagonal().iter().zip(more).map(|(c, (old, new))| c + old + new).collect())
    }

    fn accept(&mut self, own: MatRef<'_, f64>) -> Result<(), InverseError> {
        let staged = std::mem::replace(&mut self.staged, SignedPanel::none(0));
        self.pending = self.pending.and(&staged);
        if own.nrows() > 0 {
            // The new rows are those of the whole sum: terms are 0 there.
            self.tiles.append(&self.border, own);
            self.pending.columns.grow(own.nrows());
        }
        Ok(())
    }

    fn remove(&mut self, slot: usize, block: usize) -> Result<(), InverseError> {
        self.tiles.swap_remove(slot, block);
        self.pending.columns.swap_remove(slot, block);
        Ok(())
    }

    fn fold(&mut self) -> Result<(), InverseError> {
        let none = SignedPanel::none(self.rows());
        let pending = std::mem::replace(&mut self.pending, none);
        self.tiles.add(&pending);
        Ok(())
    }
}
