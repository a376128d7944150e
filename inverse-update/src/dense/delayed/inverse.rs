//! A dense C with the terms of many updates beside it, folded in by one pass.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use faer::{Mat, MatRef};

use super::terms::Terms;
use crate::change::{Capacitance, NetChange, Update, UpdateRef};
use crate::dense::from_stiffness::symmetric_inverse;
use crate::dense::precision::Precision;
use crate::dense::signed_root::{at_rows, check_diagonal, residual};
use crate::dense::store::{DenseStore, Staged};
use crate::maintained::{Maintained, Method};
use crate::matrix::SparseStiffness;
use crate::{InverseError, StorageError};

/// The number of deferred columns at which [`Delayed`] folds them into C, unless set otherwise.
pub const MOST_DELAYED: usize = 96;

/// Keeps C = K⁻¹ in a [`DenseStore`], on the host or on a device, as C₀ + Y Σ Yᵀ with Y of up to
/// some [`MOST_DELAYED`] columns.
///
/// An update K + U Λ Uᵀ on the ring's rows r reads the submatrix C_rr alone: with
/// Λ + Uᵀ C_rr U = L Σ Lᵀ and W = U L⁻ᵀ it adds the columns Y = C_:r W, C ← C − Y Σ Yᵀ; a new
/// vertex adds the row C_m: = T C_r:, T = −A22⁻¹ a12ᵀ, and C_mm = A22⁻¹ + T C_rr Tᵀ. Both are
/// columns C_:r X with X known on the host in f64. Reads between passes see the columns; a pass
/// folds all of them in at once. A batch reads one submatrix for as many splits and changes as
/// touch up to 192 rows, and stages their columns together: as many calls of the store as one
/// split.
///
/// Where C is kept in f32, solutions and columns are refined by K as those of
/// [`WoodburyF32`](crate::WoodburyF32) are. Cost: O(n r (3 + q)) per update, O(n² k) per pass of k
/// columns, O(n²) per solve.
/// # Source
/// McDaniel et al., Delayed Slater determinant update algorithms, J. Chem. Phys. 147, 2017; Yeung,
/// Crouch, Pothen, Interactively cutting and constraining vertices in meshes using augmented
/// matrices, ACM Trans. Graph. 35(2), 2016.
pub type Delayed<S> = Maintained<DelayedMethod<S>>;

/// See [`Delayed`].
pub struct DelayedMethod<S> {
    /// Behind a lock: it may need its own buffers for reading.
    store: Mutex<S>,
    pub(super) most: usize,
}

impl<S: DenseStore> Delayed<S> {
    /// Inverts `stiffness` into `store`. Cost: O(n³).
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced;
    /// [`InverseError::Storage`] if the store has not enough memory.
    pub fn new(stiffness: SparseStiffness, store: S) -> Result<Self, InverseError> {
        Self::by(DelayedMethod { store: Mutex::new(store), most: MOST_DELAYED }, stiffness)
    }

    /// The same, folding as soon as `most` columns are deferred; 0 and 1 defer nothing.
    #[must_use]
    pub fn with_most_delayed(mut self, most: usize) -> Self {
        self.set_most_delayed(most);
        self
    }

    /// The same for one that is in use; what is deferred stays so until the next update.
    pub fn set_most_delayed(&mut self, most: usize) {
        self.method().most = most;
    }

    /// Folds the deferred columns into C now, for example after the last update of a frame.
    /// # Errors
    /// [`InverseError::Storage`].
    pub fn fold(&mut self) -> Result<(), InverseError> {
        self.method().ask(|store| store.fold())
    }

    /// The store, e.g. to ask a device what it has done.
    pub fn store(&mut self) -> &mut S {
        self.method().store.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S: DenseStore> DelayedMethod<S> {
    /// The answer of the store, whose errors get the maintainer's name.
    pub(super) fn ask<T>(
        &self,
        question: impl FnOnce(&mut S) -> Result<T, S::Error>,
    ) -> Result<T, InverseError> {
        // Nothing panics half-way through a change of C.
        let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        let method = store.method();
        question(&mut store)
            .map_err(|cause| InverseError::Storage { method, cause: StorageError::new(cause) })
    }

    /// Stages an update of K by U Λ Uᵀ and, where a vertex is added, its rows C_:r `t` after it.
    /// Returns their corner `inverse` + tᵀ C_rr t.
    fn prepare(
        &self,
        k: &SparseStiffness,
        update: UpdateRef<'_>,
    ) -> Result<Mat<f64>, InverseError> {
        let net = NetChange::of(update, k.negative())?;
        let (rows, t) = (k.rows_of(update.slots()), &net.t);
        let own = self.ask(|store| store.submatrix(&rows))?;
        let terms = Terms::new::<S::Scalar>(&net, &own, k.negative())?;
        let (p, columns, m) = (net.gained, net.u.ncols(), t.ncols());
        let refine = || self.lost_terms(k, &rows, &net, &terms);
        let lost = terms.is_softening.then(refine).transpose()?;
        // C_:r t + Y Σ Y_rᵀ t, those of Y from C_:r by W, the others as they are.
        let from_c = if terms.is_softening { p } else { columns };
        let mut x = Mat::zeros(rows.len(), columns + m);
        x.subcols_mut(0, from_c).copy_from(terms.w.subcols(0, from_c));
        let inner = terms.signed(&terms.at_ring, t.as_ref());
        let border = t + terms.w.subcols(0, from_c) * inner.subrows(0, from_c);
        x.subcols_mut(columns, m).copy_from(border);
        let plus = lost.map(|lost| {
            // Their signs are + all.
            let inner = at_rows(lost.as_ref(), &rows).transpose() * t;
            let mut plus = Mat::zeros(lost.nrows(), columns + m);
            plus.subcols_mut(p, columns - p).copy_from(&lost);
            plus.subcols_mut(columns, m).copy_from(lost * inner);
            plus
        });
        let mut border = &own * x.subcols(columns, m);
        if let Some(plus) = &plus {
            border += at_rows(plus.subcols(columns, m), &rows);
        }
        let corner = &net.inverse + t.transpose() * border;
        let plus = plus.as_ref().map(|plus| plus.as_ref());
        let staged = Staged { rows: &rows, x: x.as_ref(), plus, signs: &terms.signs };
        self.stage(k, &staged, &corner, &update.removed_rows(k))?;
        Ok(corner)
    }

    /// Has the store compute what is to be added to C, and checks the diagonal with that of the
    /// `corner` of new rows.
    pub(super) fn stage(
        &self,
        k: &SparseStiffness,
        staged: &Staged<'_>,
        corner: &Mat<f64>,
        removed: &Range<usize>,
    ) -> Result<(), InverseError> {
        let diagonal = self.ask(|store| store.stage(staged))?;
        let new = corner.diagonal().column_vector().iter().copied();
        check_diagonal(k, diagonal.into_iter().chain(new), removed)
    }

    /// Y of the columns lost, n × q, from C'' N after one step of refinement by K: I + NᵀC''N does
    /// not cancel.
    /// # Errors
    /// [`InverseError::Singular`] if that is not positive definite; those of the store.
    fn lost_terms(
        &self,
        k: &SparseStiffness,
        rows: &[usize],
        change: &NetChange,
        terms: &Terms,
    ) -> Result<Mat<f64>, InverseError> {
        let lost = change.lost();
        let product = |x: Mat<f64>| self.ask(|store| store.product(rows, x.as_ref()));
        let at = terms.signed(&terms.at_ring, lost);
        let mut softened = product(lost + &terms.w * at)?;
        let residual = residual(k, rows, change, softened.as_ref())?;
        let step = self.ask(|store| store.multiply(residual.as_ref()))?;
        // Yᵀ R = Wᵀ (C R)_r.
        let inner = terms.signed(&terms.w, at_rows(step.as_ref(), rows).as_ref());
        softened += step;
        softened += product(&terms.w * inner)?;
        let one = Mat::<f64>::identity(lost.ncols(), lost.ncols());
        let g = &one + lost.transpose() * at_rows(softened.as_ref(), rows);
        Ok(softened * Capacitance::of(change.what, g.as_ref(), 0)?.half_solve(one.as_ref()))
    }

    /// Hands what is staged to the store, with the corner of new rows and the slot that goes.
    pub(super) fn accept(
        &self,
        own: MatRef<'_, f64>,
        removed: Option<usize>,
        block: usize,
    ) -> Result<(), InverseError> {
        self.ask(|store| {
            store.accept(own)?;
            if let Some(slot) = removed {
                store.remove(slot, block)?;
            }
            if store.delayed() >= self.most.max(1) {
                store.fold()?;
            }
            Ok(())
        })
    }
}

impl<S: DenseStore> Method for DelayedMethod<S> {
    const DRIFT_LIMIT: f64 = S::Scalar::DRIFT_LIMIT;
    const REFINED: bool = S::Scalar::REFINED;

    fn name(&self) -> &'static str {
        self.store.lock().unwrap_or_else(PoisonError::into_inner).method()
    }

    fn place(&self) -> Option<String> {
        self.store.lock().unwrap_or_else(PoisonError::into_inner).place()
    }

    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError> {
        let inverse = symmetric_inverse(k)?;
        self.ask(|store| store.load(inverse.as_ref()))
    }

    fn update(&mut self, k: &SparseStiffness, update: UpdateRef<'_>) -> Result<(), InverseError> {
        let own = self.prepare(k, update)?;
        self.accept(own.as_ref(), update.removed(), k.block())
    }

    fn multiply(&self, _: &SparseStiffness, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        self.ask(|store| store.multiply(x))
    }

    fn columns(&self, _: &SparseStiffness, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.ask(|store| store.columns(rows))
    }

    fn batch(whole: &mut Maintained<Self>, updates: &[Update]) -> Result<(), InverseError> {
        whole.update_all(updates)
    }
}
