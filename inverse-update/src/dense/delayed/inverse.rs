//! A dense C with the terms of many updates beside it, folded in by one pass.

use std::sync::{Mutex, MutexGuard, PoisonError};

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::accuracy::{Counts, Tally, is_too_far, kept_drift, solve_refined};
use crate::change::{LowRank, NetChange, RingChange, StiffnessChange, Update, UpdateRef};
use crate::dense::from_stiffness::symmetric_inverse;
use crate::dense::lost_terms::{Terms, at_rows, lost_terms};
use crate::dense::precision::Precision;
use crate::dense::refinement::refine_columns;
use crate::dense::signed_root::{SignedRoot, check_diagonal};
use crate::dense::store::{DenseStore, Staged};
use crate::dense::tiles::Panel;
use crate::maintainer::{InverseMaintainer, maintained};
use crate::matrix::{SparseStiffness, check_length, check_range, check_vector};

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
/// [`WoodburyF32`](crate::WoodburyF32) are. A factor that fails makes it rebuild C from K, which
/// [`Counts`] tell. Cost: O(n r (3 + q)) per update, O(n² k) per pass of k columns, O(n²) per
/// solve.
/// # Source
/// McDaniel et al., Delayed Slater determinant update algorithms, J. Chem. Phys. 147, 2017; Yeung,
/// Crouch, Pothen, Interactively cutting and constraining vertices in meshes using augmented
/// matrices, ACM Trans. Graph. 35(2), 2016.
pub struct Delayed<S: DenseStore> {
    pub(super) stiffness: SparseStiffness,
    /// Behind a lock: a solution may replace a C that it can't be refined with, and a store may
    /// need its own buffers for reading.
    kept: Mutex<Kept<S>>,
    pub(super) most: usize,
    tally: Tally,
}

struct Kept<S> {
    store: S,
    /// Whether C was computed from K since the last update.
    is_rebuilt: bool,
}

impl<S: DenseStore> Delayed<S> {
    /// Inverts `stiffness` into `store`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced;
    /// [`InverseError::Storage`] if the store has not enough memory.
    pub fn new(stiffness: SparseStiffness, mut store: S) -> Result<Self, InverseError> {
        store.load(symmetric_inverse(&stiffness)?.as_ref())?;
        let kept = Mutex::new(Kept { store, is_rebuilt: true });
        Ok(Self { stiffness, kept, most: MOST_DELAYED, tally: Tally::default() })
    }

    /// The same, folding as soon as `most` columns are deferred; 0 and 1 defer nothing.
    #[must_use]
    pub fn with_most_delayed(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// Folds the deferred columns into C now, for example after the last update of a frame.
    ///
    /// # Errors
    /// [`InverseError::Storage`].
    pub fn fold(&mut self) -> Result<(), InverseError> {
        self.store().fold()
    }

    /// The store, e.g. to ask a device what it has done.
    pub fn store(&mut self) -> &mut S {
        &mut self.kept.get_mut().unwrap_or_else(PoisonError::into_inner).store
    }

    fn lock(&self) -> MutexGuard<'_, Kept<S>> {
        // Nothing panics half-way through a change of C.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn update(&mut self, update: UpdateRef<'_>) -> Result<(), InverseError> {
        self.stiffness.check(update)?;
        match self.prepare(update) {
            // In this order, so that a store that is lost on the way leaves K as it was.
            Ok(own) => self.accept(own.as_ref(), update.removed())?,
            Err(cause) => return self.rebuild_after(cause, update),
        }
        self.stiffness.apply_update(update);
        Ok(())
    }

    /// Stages an update of K by U Λ Uᵀ and, where a vertex is added, its rows C_:r `t` after it.
    /// Returns their corner `inverse` + tᵀ C_rr t.
    fn prepare(&mut self, update: UpdateRef<'_>) -> Result<Mat<f64>, InverseError> {
        let Self { stiffness, kept, .. } = self;
        let net = NetChange::of(update, stiffness.negative())?;
        let (rows, change, t) = (stiffness.rows_of(update.slots()), net.low_rank(), &net.t);
        let store = &mut kept.get_mut().unwrap_or_else(PoisonError::into_inner).store;
        let own = store.submatrix(&rows)?;
        let (terms, softening) = small_algebra::<S::Scalar>(&change, &own, stiffness.negative())?;
        let (p, k, m) = (change.gained.ncols(), change.columns(), t.ncols());
        let is_softened = softening <= <S::Scalar as Precision>::SOFTENING;
        let lost = match is_softened {
            true => Some(lost_terms(store, stiffness, &rows, &change, &terms)?),
            false => None,
        };
        // C_:r t + Y Σ Y_rᵀ t, those of Y from C_:r by W, the others as they are.
        let from_c = if is_softened { p } else { k };
        let mut x = Mat::zeros(rows.len(), k + m);
        x.subcols_mut(0, from_c).copy_from(terms.w.subcols(0, from_c));
        let inner = terms.signed(terms.at_ring.as_ref(), t.as_ref());
        x.subcols_mut(k, m).copy_from(t + terms.w.subcols(0, from_c) * inner.subrows(0, from_c));
        let plus = lost.map(|lost| {
            // Their signs are + all.
            let inner = at_rows(&lost, &rows).transpose() * t;
            let mut plus = Mat::zeros(lost.nrows(), k + m);
            plus.subcols_mut(p, k - p).copy_from(&lost);
            plus.subcols_mut(k, m).copy_from(lost * inner);
            plus
        });
        let mut border = &own * x.subcols(k, m);
        if let Some(plus) = &plus {
            border += at_rows(&plus.subcols(k, m).to_owned(), &rows);
        }
        let corner = &net.inverse + t.transpose() * border;
        let staged = Staged {
            rows: &rows,
            x: x.as_ref(),
            plus: plus.as_ref().map(|plus| plus.as_ref()),
            signs: &terms.signs,
        };
        let diagonal = store.stage(&staged)?.into_iter().chain((0..m).map(|a| corner[(a, a)]));
        check_diagonal(stiffness, diagonal, &update.removed_rows(stiffness))?;
        Ok(corner)
    }

    /// Hands what is staged to the store, with the corner of new rows and the slot that goes.
    pub(super) fn accept(
        &mut self,
        own: MatRef<'_, f64>,
        removed: Option<usize>,
    ) -> Result<(), InverseError> {
        let (block, most) = (self.stiffness.block(), self.most);
        let kept = self.kept.get_mut().unwrap_or_else(PoisonError::into_inner);
        kept.is_rebuilt = false;
        kept.store.accept(own)?;
        if let Some(slot) = removed {
            kept.store.remove(slot, block)?;
        }
        if kept.store.delayed() >= most.max(1) {
            kept.store.fold()?;
        }
        Ok(())
    }

    /// Makes an update whose small factor failed: K changes and is inverted from scratch. An error
    /// of the store is no failure of the update and is returned.
    fn rebuild_after(
        &mut self,
        cause: InverseError,
        update: UpdateRef<'_>,
    ) -> Result<(), InverseError> {
        if matches!(cause, InverseError::Storage { .. }) {
            return Err(cause);
        }
        let mut stiffness = self.stiffness.clone();
        stiffness.apply_update(update);
        self.replace_by(&stiffness)?;
        tracing::warn!(%cause, "{}: update refused, inverse computed afresh", self.name());
        self.stiffness = stiffness;
        self.tally.rebuilt_for_pivot();
        Ok(())
    }

    fn replace_by(&self, stiffness: &SparseStiffness) -> Result<(), InverseError> {
        let inverse = symmetric_inverse(stiffness)?;
        let mut kept = self.lock();
        kept.store.load(inverse.as_ref())?;
        kept.is_rebuilt = true;
        Ok(())
    }

    fn kept_drift(&self, seed: u64) -> Result<f64, InverseError> {
        let mut failure = None;
        let drift = kept_drift(&self.stiffness, seed, |at| {
            self.lock().store.columns(at).unwrap_or_else(|error| {
                failure = Some(error);
                Mat::zeros(self.stiffness.dofs(), at.len())
            })
        });
        failure.map_or(Ok(drift), Err)
    }

    /// X with K X = F by refinement from `start`; where C no longer helps it is replaced, once.
    fn refined(
        &self,
        load: &Panel,
        start: impl Fn(&mut S) -> Result<Mat<f64>, InverseError>,
    ) -> Result<Panel, InverseError> {
        loop {
            let mut kept = self.lock();
            let is_rebuilt = kept.is_rebuilt;
            let name = kept.store.method();
            let first = Panel::from_matrix(start(&mut kept.store)?.as_ref());
            let multiply = |x: &Panel| {
                let product = kept.store.multiply(x.to_matrix().as_ref())?;
                Ok(Panel::from_matrix(product.as_ref()))
            };
            match refine_columns(name, &self.stiffness, &self.tally, load, first, multiply) {
                Err(InverseError::NotRefined { .. }) if !is_rebuilt => {}
                other => return other,
            }
            drop(kept);
            self.replace_by(&self.stiffness)?;
            self.tally.rebuilt();
            tracing::warn!("{name}: refinement failed, inverse computed afresh");
        }
    }
}

/// W, Σ, Y_r of an update and the smallest pivot of what it takes away, from C_rr alone.
pub(super) fn small_algebra<E: Precision>(
    change: &LowRank<'_>,
    c_rr: &Mat<f64>,
    negative: usize,
) -> Result<(Terms, f64), InverseError> {
    let u = change.beside(Mat::zeros(c_rr.nrows(), 0).as_ref());
    let own = c_rr * &u;
    let root = SignedRoot::new::<E>(change, own.as_ref(), negative)?;
    let signs = root.signs.iter().map(|sign| -sign).collect();
    let (w, at_ring) = (&u * &root.root, own * &root.root);
    Ok((Terms { w, signs, at_ring }, root.softening))
}

impl<S: DenseStore> InverseMaintainer for Delayed<S> {
    maintained!(S::Scalar::DRIFT_LIMIT);

    fn name(&self) -> &'static str {
        self.lock().store.method()
    }

    fn place(&self) -> Option<String> {
        self.lock().store.place()
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        self.update_all(updates)
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let rows = self.stiffness.dofs();
        if S::Scalar::REFINED {
            check_vector("f", f, rows)?;
            check_length("u", u, rows)?;
            let f = MatRef::from_column_major_slice(f, rows, 1);
            let load = Panel::from_matrix(f);
            self.refined(&load, |store| store.multiply(f))?.copy_column(0, u);
            return Ok(());
        }
        let store = &mut self.lock().store;
        solve_refined(&self.stiffness, &self.tally, (f, u), |x| {
            let product = store.multiply(MatRef::from_column_major_slice(x, rows, 1))?;
            x.copy_from_slice(product.col_as_slice(0));
            Ok(())
        })
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        let rows = self.stiffness.rows_of(slots);
        if !S::Scalar::REFINED {
            return self.lock().store.columns(&rows);
        }
        let load = Panel::from_matrix(self.stiffness.unit_columns(&rows).as_ref());
        Ok(self.refined(&load, |store| store.columns(&rows))?.to_matrix())
    }

    fn holds_columns(&self) -> bool {
        // What is refined is a solution for every column.
        !S::Scalar::REFINED
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.replace_by(&self.stiffness)
    }
}
