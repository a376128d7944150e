//! What an update adds to the dense inverse, from the ring's columns and factors of the change.

use faer::Mat;

use super::inverse::{PackedInverse, Prepared};
use crate::InverseError;
use crate::change::{Capacitance, LowRank, NetChange, UpdateRef};
use crate::dense::lost_terms::residual;
use crate::dense::precision::Precision;
use crate::dense::signed_root::{SignedRoot, check_diagonal};
use crate::dense::tiles::{Panel, SignedPanel};

impl<E: Precision> PackedInverse<E> {
    pub(super) fn prepare(&self, update: UpdateRef<'_>) -> Result<Prepared, InverseError> {
        let stiffness = &self.stiffness;
        let net = NetChange::of(update, stiffness.negative())?;
        let (rows, change) = (stiffness.rows_of(update.slots()), net.low_rank());
        let (k, m) = (change.columns(), net.t.ncols());
        let product = self.inverse().select_times(&rows, change.beside(net.t.as_ref()).as_ref());
        let own = product.at_rows(&rows);
        let own = own.as_ref().subcols(0, k);
        let root = SignedRoot::new::<E>(&change, own, stiffness.negative())?;
        let mut coefficients = Mat::<f64>::zeros(k + m, k);
        coefficients.as_mut().subrows_mut(0, k).copy_from(&root.root);
        let signs = root.signs.iter().map(|sign| -sign).collect();
        let mut terms = SignedPanel { columns: product.times(coefficients.as_ref()), signs };
        if root.softening <= E::SOFTENING {
            self.refine_lost_terms(&rows, &change, &product, &mut terms)?;
        }
        // C_:r Tᵀ after the update, from the ring's columns alone.
        let mut coupling = product.some_columns(k..k + m);
        if m > 0 {
            let at = terms.columns.at_rows(&rows);
            coupling.add_times(&terms.signed(), (at.transpose() * &net.t).as_ref());
        }
        let own = &net.inverse + net.t.transpose() * coupling.at_rows(&rows);
        let diagonal = self.inverse().diagonal_with(&terms);
        let new = (0..m).map(|a| own[(a, a)]);
        check_diagonal(
            stiffness,
            diagonal.into_iter().chain(new),
            &update.removed_rows(stiffness),
        )?;
        Ok(Prepared { terms, coupling, own })
    }

    /// Computes the terms of what is lost again, from C'' N after one step of refinement by K:
    /// I + NᵀC''N does not cancel.
    fn refine_lost_terms(
        &self,
        rows: &[usize],
        change: &LowRank<'_>,
        product: &Panel,
        terms: &mut SignedPanel,
    ) -> Result<(), InverseError> {
        let (p, q) = (change.gained.ncols(), change.lost.ncols());
        let mut softened = product.some_columns(p..p + q);
        let at = terms.columns.at_rows(rows);
        softened.add_times(&terms.signed(), (at.transpose() * change.lost).as_ref());
        let x = softened.to_matrix();
        let residual = residual(&self.stiffness, rows, change, x.as_ref())?;
        let residual = Panel::from_matrix(residual.as_ref());
        let step = self.inverse().multiply(&residual);
        softened.add_times(&step, Mat::<f64>::identity(q, q).as_ref());
        softened.add_times(&terms.signed(), terms.columns.inner(&residual).as_ref());
        let g = Mat::<f64>::identity(q, q) + change.lost.transpose() * softened.at_rows(rows);
        let factor = Capacitance::of(change.what, g.as_ref())?;
        let root = factor.half_solve(Mat::<f64>::identity(q, q).as_ref());
        terms.columns = terms.columns.some_columns(0..p).beside(&softened.times(root.as_ref()));
        Ok(())
    }
}
