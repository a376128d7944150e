//! What an update adds to the dense inverse, from the ring's columns and factors of the change.

use std::ops::Range;

use faer::{Mat, MatRef};

use super::PackedInverse;
use crate::capacitance::Capacitance;
use crate::net_change::{NetChange, NewRows};
use crate::panel::Panel;
use crate::soften::residual;
use crate::stored::Stored;
use crate::tiles::SignedPanel;
use crate::update::{LowRank, SignedRoot};
use crate::{InverseError, RingChange};

/// What an update adds to C, and the new vertex's rows of it.
pub(super) struct Prepared {
    pub terms: SignedPanel,
    pub border: Option<(Panel, Mat<f64>)>,
}

impl<E: Stored> PackedInverse<E> {
    /// C S X with what is pending.
    fn select_times(&self, rows: &[usize], x: MatRef<'_, f64>) -> Panel {
        let mut product = self.tiles().select_times(rows, x);
        if !self.pending.signs.is_empty() {
            let at = self.pending.columns.at_rows(rows);
            product.add_times(&self.pending.signed(), (at.transpose() * x).as_ref());
        }
        product
    }

    /// C X with what is pending.
    fn multiply(&self, x: &Panel) -> Panel {
        let mut product = self.tiles().multiply(x);
        if !self.pending.signs.is_empty() {
            let inner = self.pending.columns.inner(x);
            product.add_times(&self.pending.signed(), inner.as_ref());
        }
        product
    }

    /// The terms of an update of K by U Λ Uᵀ, and C S `more` before the update.
    fn prepare(
        &self,
        rows: &[usize],
        change: &LowRank<'_>,
        more: MatRef<'_, f64>,
        removed: Range<usize>,
    ) -> Result<(SignedPanel, Panel), InverseError> {
        let k = change.columns();
        let product = self.select_times(rows, change.beside(more).as_ref());
        let own = product.at_rows(rows);
        let own = own.as_ref().subcols(0, k);
        let root = if self.stiffness.negative() == 0 {
            SignedRoot::definite::<E>(change, own)?
        } else {
            SignedRoot::quasi_definite::<E>(change, own)?
        };
        let terms = |root: &SignedRoot| {
            let mut coefficients = Mat::<f64>::zeros(product.columns(), k);
            coefficients.as_mut().subrows_mut(0, k).copy_from(&root.root);
            let signs = root.signs.iter().map(|sign| -sign).collect();
            SignedPanel { columns: product.times(coefficients.as_ref()), signs }
        };
        let mut terms = terms(&root);
        if root.softening <= E::SOFTENING {
            self.refine_softened(rows, change, &product, &mut terms)?;
        }
        self.check_diagonal(&terms, removed)?;
        let behind = product.some_columns(k..k + more.ncols());
        Ok((terms, behind))
    }

    /// Computes the terms of what is lost again, from C'' N after one step of refinement by K:
    /// I + NᵀC''N does not cancel.
    fn refine_softened(
        &self,
        rows: &[usize],
        change: &LowRank<'_>,
        product: &Panel,
        terms: &mut SignedPanel,
    ) -> Result<(), InverseError> {
        let (p, q) = (change.gained.ncols(), change.lost.ncols());
        let lost = Mat::from_fn(product.columns(), q, |i, j| if i == p + j { 1.0 } else { 0.0 });
        let mut softened = product.times(lost.as_ref());
        let at = terms.columns.at_rows(rows);
        softened.add_times(&terms.signed(), (at.transpose() * change.lost).as_ref());
        let x = softened.to_matrix();
        let residual = residual(&self.stiffness, rows, change, x.as_ref())?;
        let residual = Panel::from_matrix(residual.as_ref());
        let step = self.multiply(&residual);
        softened.add_times(&step, Mat::<f64>::identity(q, q).as_ref());
        softened.add_times(&terms.signed(), terms.columns.inner(&residual).as_ref());
        let g = Mat::<f64>::identity(q, q) + change.lost.transpose() * softened.at_rows(rows);
        let factor = Capacitance::of(change.what, g.as_ref())?;
        let root = factor.half_solve(Mat::<f64>::identity(q, q).as_ref());
        let again = softened.times(root.as_ref());
        let first = Mat::from_fn(p + q, p + q, |i, j| if i == j && i < p { 1.0 } else { 0.0 });
        let last = Mat::from_fn(q, p + q, |i, j| if j == p + i { 1.0 } else { 0.0 });
        let mut columns = terms.columns.times(first.as_ref());
        columns.add_times(&again, last.as_ref());
        terms.columns = columns;
        Ok(())
    }

    pub(super) fn prepare_split(&self, change: &RingChange) -> Result<Prepared, InverseError> {
        let negative = self.stiffness.negative();
        let rows = self.rows(&change.slots);
        let net = NetChange::new(change, negative)?;
        let NewRows { t, inverse } = NewRows::new(change, negative)?;
        // C_:r Tᵀ after the update, from the ring's columns alone.
        let (terms, mut coupling) = self.prepare(&rows, &net.of_split(), t.as_ref(), 0..0)?;
        let at = terms.columns.at_rows(&rows);
        coupling.add_times(&terms.signed(), (at.transpose() * &t).as_ref());
        let own = inverse + t.transpose() * coupling.at_rows(&rows);
        for a in 0..own.nrows() {
            self.check_sign(self.stiffness.dofs() + a, own[(a, a)])?;
        }
        Ok(Prepared { terms, border: Some((coupling, own)) })
    }

    pub(super) fn prepare_merge(
        &self,
        slot: usize,
        change: &RingChange,
    ) -> Result<Prepared, InverseError> {
        let net = NetChange::new(change, self.stiffness.negative())?;
        let block = self.stiffness.block();
        self.prepare_low_rank(&change.slots, &net.of_merge(), block * slot..block * (slot + 1))
    }

    pub(super) fn prepare_low_rank(
        &self,
        slots: &[usize],
        change: &LowRank<'_>,
        removed: Range<usize>,
    ) -> Result<Prepared, InverseError> {
        let rows = self.rows(slots);
        let nothing = Mat::<f64>::zeros(rows.len(), 0);
        let (terms, _) = self.prepare(&rows, change, nothing.as_ref(), removed)?;
        Ok(Prepared { terms, border: None })
    }

    pub(super) fn rows(&self, slots: &[usize]) -> Vec<usize> {
        let block = self.stiffness.block();
        slots.iter().flat_map(|&slot| block * slot..block * (slot + 1)).collect()
    }

    /// A finite diagonal of the right signs shows that the terms are finite, and bounds a positive
    /// definite C; anything else is a failed update. Rows about to be removed are let off: without
    /// their ring they may have any sign in a quasi-definite C.
    fn check_diagonal(
        &self,
        terms: &SignedPanel,
        removed: Range<usize>,
    ) -> Result<(), InverseError> {
        let tiles = self.tiles();
        let pending = self.pending.diagonal();
        let sums = tiles.diagonal().iter().zip(terms.diagonal()).zip(pending);
        let mut kept = sums.enumerate().filter(|(i, _)| !removed.contains(i));
        kept.try_for_each(|(i, ((c, new), old))| self.check_sign(i, c + old + new))
    }

    fn check_sign(&self, row: usize, value: f64) -> Result<(), InverseError> {
        if self.stiffness.sign(row) * value > 0.0 && value.is_finite() {
            return Ok(());
        }
        let what = "the diagonal of the inverse";
        Err(InverseError::Singular { what, row, value, limit: 0.0 })
    }
}
