//! `woodbury`, `woodbury_f32`: C in packed tiles, changed by factored low-rank updates.

use faer::{Mat, MatRef};

use super::from_stiffness::symmetric_inverse;
use super::precision::Precision;
use super::signed_root::{SignedRoot, check_diagonal, residual};
use super::tiles::{Deferred, Panel, SignedPanel};
use crate::InverseError;
use crate::change::{Capacitance, NetChange, Update, UpdateRef, beside};
use crate::maintained::{Maintained, Method};
use crate::matrix::SparseStiffness;

/// Keeps C = K⁻¹ dense, lower half only, by symmetric low-rank updates.
///
/// Eliminating the new vertex leaves K + F Fᵀ − b A22⁻¹ bᵀ = K + U Λ Uᵀ on the old rows, U = (P N)
/// without what cancels between stiff and soft tissue, Λ = diag(1, −1), so a split is
/// 1. Z = C_:r U, Λ + Uᵀ Z_r = L Σ Lᵀ, Y = Z L⁻ᵀ, C ← C − Y Σ Yᵀ,
/// 2. T = −A22⁻¹ a12ᵀ, C_m: = T C_r:, C_mm = A22⁻¹ + T C_rr Tᵀ,
///
/// and a merge the same in reverse. All of it is computed on the ring's columns first; then C is
/// read and written once. For a quasi-definite K the factor is one by eigenvectors, with the
/// signature of Λ.
///
/// A batch of updates gathers up to 96 columns Y before the pass, and corrects by them what it
/// reads of C in the meantime.
///
/// Cost: O(n²(3 + q)) per update, O(n²) per solve, n²/2 stored numbers.
/// # Source
/// Hager, Updating the inverse of a matrix, SIAM Review 31(2), 1989; Vanderbei, Symmetric
/// quasidefinite matrices, SIAM J. Optimization 5(1), 1995; McDaniel et al., Delayed Slater
/// determinant update algorithms, J. Chem. Phys. 147, 2017.
pub type Woodbury = Maintained<Packed<f64>>;

/// [`Woodbury`] in f32, half the memory and the time per pass: scene name `woodbury_f32`.
///
/// The small algebra of updates is in f64. Every solution and every column is refined by K in f64
/// ([`REFINED_RESIDUAL`](crate::REFINED_RESIDUAL)); if that fails the inverse is rebuilt from K.
pub type WoodburyF32 = Maintained<Packed<f32>>;

/// Columns of updates deferred in a batch before a pass over C adds them.
const DEFERRED: usize = 96;

/// C, lower half.
#[derive(Default)]
pub struct Packed<E> {
    inverse: Deferred<E>,
    /// Whether passes are left to the end of a batch.
    is_deferring: bool,
}

/// What an update adds to C.
struct Prepared {
    terms: SignedPanel,
    /// C_:m and C_mm of the vertex that is added, without columns where none is.
    coupling: Panel,
    own: Mat<f64>,
}

impl<E: Precision> Packed<E> {
    fn prepare(
        &self,
        stiffness: &SparseStiffness,
        update: UpdateRef<'_>,
    ) -> Result<Prepared, InverseError> {
        let net = NetChange::of(update, stiffness.negative())?;
        let rows = stiffness.rows_of(update.slots());
        let (k, m) = (net.u.ncols(), net.t.ncols());
        let factors = beside(&[net.u.as_ref(), net.t.as_ref()]);
        let product = self.inverse.select_times(&rows, factors.as_ref());
        let own = product.at_rows(&rows);
        let own = own.as_ref().subcols(0, k);
        let root = SignedRoot::new::<E>(&net, own, stiffness.negative())?;
        let mut coefficients = Mat::<f64>::zeros(k + m, k);
        coefficients.as_mut().subrows_mut(0, k).copy_from(&root.root);
        let signs = root.signs.iter().map(|sign| -sign).collect();
        let mut terms = SignedPanel { columns: product.times(coefficients.as_ref()), signs };
        if root.softening <= E::SOFTENING {
            self.refine_lost_terms(stiffness, (&rows, &net), &product, &mut terms)?;
        }
        // C_:r Tᵀ after the update, from the ring's columns alone.
        let mut coupling = product.some_columns(k..k + m);
        if m > 0 {
            let at = terms.columns.at_rows(&rows);
            coupling.add_times(&terms.signed(), (at.transpose() * &net.t).as_ref());
        }
        let own = &net.inverse + net.t.transpose() * coupling.at_rows(&rows);
        let diagonal = self.inverse.diagonal_with(&terms);
        let new = (0..m).map(|a| own[(a, a)]);
        let removed = update.removed_rows(stiffness);
        check_diagonal(stiffness, diagonal.into_iter().chain(new), &removed)?;
        Ok(Prepared { terms, coupling, own })
    }

    /// Computes the terms of what is lost again, from C'' N after one step of refinement by K:
    /// I + NᵀC''N does not cancel.
    fn refine_lost_terms(
        &self,
        stiffness: &SparseStiffness,
        (rows, change): (&[usize], &NetChange),
        product: &Panel,
        terms: &mut SignedPanel,
    ) -> Result<(), InverseError> {
        let (p, q) = (change.gained, change.lost().ncols());
        let mut softened = product.some_columns(p..p + q);
        let at = terms.columns.at_rows(rows);
        softened.add_times(&terms.signed(), (at.transpose() * change.lost()).as_ref());
        let x = softened.to_matrix();
        let residual = residual(stiffness, rows, change, x.as_ref())?;
        let residual = Panel::from_matrix(residual.as_ref());
        let step = self.inverse.multiply(&residual);
        softened.add_times(&step, Mat::<f64>::identity(q, q).as_ref());
        softened.add_times(&terms.signed(), terms.columns.inner(&residual).as_ref());
        let g = Mat::<f64>::identity(q, q) + change.lost().transpose() * softened.at_rows(rows);
        let factor = Capacitance::of(change.what, g.as_ref(), 0)?;
        let root = factor.half_solve(Mat::<f64>::identity(q, q).as_ref());
        terms.columns = terms.columns.some_columns(0..p).beside(&softened.times(root.as_ref()));
        Ok(())
    }
}

impl<E: Precision> Method for Packed<E> {
    const DRIFT_LIMIT: f64 = E::DRIFT_LIMIT;
    const REFINED: bool = E::REFINED;

    fn name(&self) -> &'static str {
        E::METHOD
    }

    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError> {
        self.inverse = Deferred::from_lower(symmetric_inverse(k)?.as_ref());
        Ok(())
    }

    fn update(&mut self, k: &SparseStiffness, update: UpdateRef<'_>) -> Result<(), InverseError> {
        let Prepared { terms, coupling, own } = self.prepare(k, update)?;
        self.inverse.defer(terms);
        if let Some(slot) = update.removed() {
            self.inverse.swap_remove(slot, k.block());
        }
        if !self.is_deferring {
            self.inverse.flush();
        }
        self.inverse.append(&coupling, own.as_ref());
        Ok(())
    }

    fn multiply(&self, _: &SparseStiffness, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        Ok(self.inverse.multiply(&Panel::from_matrix(x)).to_matrix())
    }

    fn columns(&self, _: &SparseStiffness, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        Ok(self.inverse.gather(rows))
    }

    fn batch(whole: &mut Maintained<Self>, updates: &[Update]) -> Result<(), InverseError> {
        whole.method().is_deferring = true;
        let made = updates.iter().enumerate().try_for_each(|(done, update)| {
            let made = whole.update(update.borrowed());
            if whole.method().inverse.pending() >= DEFERRED {
                whole.method().inverse.flush();
            }
            made.map_err(|source| InverseError::in_batch(done, source))
        });
        whole.method().is_deferring = false;
        whole.method().inverse.flush();
        made
    }
}
