//! C as packed tiles and columns that no pass has added to them yet.

use faer::{Mat, MatRef};

use super::packed::Tiles;
use super::panel::Panel;
use super::pass::SignedPanel;
use crate::dense::precision::Precision;

/// C = T + Y Σ Yᵀ with T in tiles. What is read is C; one pass adds Y Σ Yᵀ to T.
#[derive(Debug, Clone, Default)]
pub(crate) struct Deferred<E> {
    tiles: Tiles<E>,
    pending: SignedPanel,
}

impl<E: Precision> Deferred<E> {
    /// Takes the lower triangle of a square matrix, rounded.
    pub(crate) fn from_lower(matrix: MatRef<'_, f64>) -> Self {
        let pending = SignedPanel::none(matrix.nrows());
        Self { tiles: Tiles::from_lower(matrix), pending }
    }

    /// Columns of Y.
    pub(crate) fn pending(&self) -> usize {
        self.pending.signs.len()
    }

    /// C S X, with S the selection of `rows`.
    pub(crate) fn select_times(&self, rows: &[usize], x: MatRef<'_, f64>) -> Panel {
        let mut product = self.tiles.select_times(rows, x);
        if self.pending() > 0 {
            let at = self.pending.columns.at_rows(rows);
            product.add_times(&self.pending.signed(), (at.transpose() * x).as_ref());
        }
        product
    }

    /// C X.
    pub(crate) fn multiply(&self, x: &Panel) -> Panel {
        let mut product = self.tiles.multiply(x);
        if self.pending() > 0 {
            let inner = self.pending.columns.inner(x);
            product.add_times(&self.pending.signed(), inner.as_ref());
        }
        product
    }

    /// The columns of C at these rows.
    pub(crate) fn gather(&self, rows: &[usize]) -> Mat<f64> {
        let mut columns = self.tiles.gather(rows);
        if self.pending() > 0 {
            let at = self.pending.columns.at_rows(rows);
            columns += self.pending.signed().times(at.transpose()).to_matrix();
        }
        columns
    }

    /// C on these rows and columns.
    pub(crate) fn submatrix(&self, rows: &[usize]) -> Mat<f64> {
        let at = self.pending.columns.at_rows(rows);
        let signs = &self.pending.signs;
        let signed = Mat::from_fn(at.nrows(), at.ncols(), |i, k| signs[k] * at[(i, k)]);
        self.tiles.submatrix(rows) + signed * at.transpose()
    }

    /// The diagonal of C with further terms.
    pub(crate) fn diagonal_with(&self, terms: &SignedPanel) -> Vec<f64> {
        let more = self.pending.diagonal().into_iter().zip(terms.diagonal());
        self.tiles.diagonal.iter().zip(more).map(|(c, (old, new))| c + old + new).collect()
    }

    /// C ← C + `terms`, which the next pass adds to the tiles.
    pub(crate) fn defer(&mut self, terms: SignedPanel) {
        self.pending = if self.pending() == 0 { terms } else { self.pending.and(&terms) };
    }

    /// Appends rows: `coupling` is n × m, `own` the new m × m corner.
    pub(crate) fn append(&mut self, coupling: &Panel, own: MatRef<'_, f64>) {
        // The new rows are those of the whole sum: Y is 0 there.
        self.tiles.append(coupling, own);
        self.pending.columns.grow(own.nrows());
    }

    /// Removes the rows and columns of a slot; the last slot's move into the gap.
    pub(crate) fn swap_remove(&mut self, slot: usize, block: usize) {
        self.tiles.swap_remove(slot, block);
        self.pending.columns.swap_remove(slot, block);
    }

    /// Adds Y Σ Yᵀ to the tiles: the pass.
    pub(crate) fn flush(&mut self) {
        let none = SignedPanel::none(self.pending.columns.rows);
        let pending = std::mem::replace(&mut self.pending, none);
        self.tiles.add(&pending);
    }
}
