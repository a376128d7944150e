//! `delayed`: a dense C with the terms of many updates beside it, folded in by one pass.

mod batch;

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use faer::{Mat, MatRef};

use crate::change::{check_length, check_range, check_vector};
use crate::counts::Tally;
use crate::dense_store::{DenseStore, Staged};
use crate::drift::{is_too_far, kept_drift};
use crate::fresh::symmetric_inverse;
use crate::net_change::{NetChange, NewRows};
use crate::panel::Panel;
use crate::refine::refine_columns;
use crate::residual::refine_once;
use crate::soften::{Terms, at_rows, softened_terms};
use crate::stored::Stored;
use crate::update::{LowRank, SignedRoot};
use crate::{
    Counts, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, Update,
};

/// Columns put off at which [`Delayed`] folds them into C, unless it is told otherwise.
pub const MOST_DELAYED: usize = 96;

/// Keeps C = K⁻¹ in a [`DenseStore`], on the host or on a device, as C₀ + Y Σ Yᵀ with Y of up to
/// some [`MOST_DELAYED`] columns.
///
/// An update K + U Λ Uᵀ on the ring's rows r reads the block C_rr alone: with
/// Λ + Uᵀ C_rr U = L Σ Lᵀ and W = U L⁻ᵀ it adds the columns Y = C_:r W, C ← C − Y Σ Yᵀ; a new
/// vertex adds the row C_m: = T C_r:, T = −A22⁻¹ a12ᵀ, and C_mm = A22⁻¹ + T C_rr Tᵀ. Both are
/// columns C_:r X with X known on the host in f64. Reads between passes see the columns; a pass
/// folds all of them in at once. A batch reads one block for as many splits and changes as touch up to 192
/// rows, and hands their columns over together: as many calls of the store as one split.
///
/// Where C is kept in f32, solutions and columns are refined by K as those of
/// [`WoodburyF32`](crate::WoodburyF32) are. A factor that fails makes it start afresh from K, which
/// [`Counts`] tell. Cost: O(n r (3 + q)) per update, O(n² k) per pass of k columns, O(n²) per
/// solve.
/// # Source
/// McDaniel et al., Delayed Slater determinant update algorithms, J. Chem. Phys. 147, 2017; Yeung,
/// Crouch, Pothen, Interactively cutting and constraining vertices in meshes using augmented
/// matrices, ACM Trans. Graph. 35(2), 2016.
pub struct Delayed<S: DenseStore> {
    stiffness: SparseStiffness,
    /// Behind a lock: a solution may replace a C that it can't be refined with, and a store may
    /// need its own room for reading.
    kept: Mutex<Kept<S>>,
    most: usize,
    tally: Tally,
}

struct Kept<S> {
    store: S,
    /// Whether nothing happened since C was computed from K.
    is_fresh: bool,
}

/// An update, staged: what the store has to append.
struct Prepared {
    own: Mat<f64>,
}

impl<S: DenseStore> Delayed<S> {
    /// Inverts `stiffness` into `store`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced;
    /// [`InverseError::Storage`] if the store has no room.
    pub fn new(stiffness: SparseStiffness, mut store: S) -> Result<Self, InverseError> {
        store.load(symmetric_inverse(&stiffness)?.as_ref())?;
        let kept = Mutex::new(Kept { store, is_fresh: true });
        Ok(Self { stiffness, kept, most: MOST_DELAYED, tally: Tally::default() })
    }

    /// The same, folding as soon as `most` columns are put off; 0 and 1 put nothing off.
    #[must_use]
    pub fn with_most_delayed(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// Folds what is put off into C now, as after the last update of a frame.
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

    fn rows(&self, slots: &[usize]) -> Vec<usize> {
        let block = self.stiffness.block();
        slots.iter().flat_map(|&slot| block * slot..block * (slot + 1)).collect()
    }

    /// Stages an update of K by U Λ Uᵀ, and rows C_:r `t` after it with the corner `inverse` + tᵀ
    /// C_rr t.
    fn prepare(
        &mut self,
        slots: &[usize],
        change: &LowRank<'_>,
        (t, inverse): (MatRef<'_, f64>, MatRef<'_, f64>),
        removed: Range<usize>,
    ) -> Result<Prepared, InverseError> {
        let rows = self.rows(slots);
        let Self { stiffness, kept, .. } = self;
        let store = &mut kept.get_mut().unwrap_or_else(PoisonError::into_inner).store;
        let block = store.block(&rows)?;
        let (terms, softening) = small_algebra::<S::Scalar>(change, &block, stiffness.negative())?;
        let (p, k, m) = (change.gained.ncols(), change.columns(), t.ncols());
        let is_softened = softening <= <S::Scalar as Stored>::SOFTENING;
        let lost = match is_softened {
            true => Some(softened_terms(store, stiffness, &rows, change, &terms)?),
            false => None,
        };
        // C_:r t + Y Σ Y_rᵀ t, those of Y from C_:r by W, the others as they are.
        let from_c = if is_softened { p } else { k };
        let mut x = Mat::zeros(rows.len(), k + m);
        x.subcols_mut(0, from_c).copy_from(terms.w.subcols(0, from_c));
        let inner = terms.signed(terms.at_ring.as_ref(), t);
        x.subcols_mut(k, m).copy_from(t + terms.w.subcols(0, from_c) * inner.subrows(0, from_c));
        let plus = lost.map(|lost| {
            // Their signs are + all.
            let inner = at_rows(&lost, &rows).transpose() * t;
            let mut plus = Mat::zeros(lost.nrows(), k + m);
            plus.subcols_mut(p, k - p).copy_from(&lost);
            plus.subcols_mut(k, m).copy_from(lost * inner);
            plus
        });
        let mut border = &block * x.subcols(k, m);
        if let Some(plus) = &plus {
            border += at_rows(&plus.subcols(k, m).to_owned(), &rows);
        }
        let own = inverse + t.transpose() * border;
        let staged = Staged {
            rows: &rows,
            x: x.as_ref(),
            plus: plus.as_ref().map(|plus| plus.as_ref()),
            signs: &terms.signs,
        };
        let diagonal = store.stage(&staged)?;
        self.check_diagonal(&diagonal, &own, removed)?;
        Ok(Prepared { own })
    }

    /// A finite diagonal of the right signs shows that the terms are finite, and bounds a positive
    /// definite C; anything else is a failed update. Rows about to be removed are let off: without
    /// their ring they may have any sign in a quasi-definite C.
    fn check_diagonal(
        &self,
        diagonal: &[f64],
        own: &Mat<f64>,
        removed: Range<usize>,
    ) -> Result<(), InverseError> {
        let new = (0..own.nrows()).map(|a| own[(a, a)]);
        for (row, value) in diagonal.iter().copied().chain(new).enumerate() {
            let is_right = self.stiffness.sign(row) * value > 0.0 && value.is_finite();
            if !is_right && !removed.contains(&row) {
                let what = "the diagonal of the inverse";
                return Err(InverseError::Singular { what, row, value, limit: 0.0 });
            }
        }
        Ok(())
    }

    fn prepare_split(&mut self, change: &RingChange) -> Result<Prepared, InverseError> {
        let negative = self.stiffness.negative();
        let net = NetChange::new(change, negative)?;
        let NewRows { t, inverse } = NewRows::new(change, negative)?;
        self.prepare(&change.slots, &net.of_split(), (t.as_ref(), inverse.as_ref()), 0..0)
    }

    fn prepare_merge(
        &mut self,
        slot: usize,
        change: &RingChange,
    ) -> Result<Prepared, InverseError> {
        let net = NetChange::new(change, self.stiffness.negative())?;
        let block = self.stiffness.block();
        self.prepare_low_rank(&change.slots, &net.of_merge(), block * slot..block * (slot + 1))
    }

    fn prepare_low_rank(
        &mut self,
        slots: &[usize],
        change: &LowRank<'_>,
        removed: Range<usize>,
    ) -> Result<Prepared, InverseError> {
        let t = Mat::<f64>::zeros(change.gained.nrows(), 0);
        let inverse = Mat::<f64>::zeros(0, 0);
        self.prepare(slots, change, (t.as_ref(), inverse.as_ref()), removed)
    }

    /// Hands the staged update to the store, and K the same: in this order, so that a store that is
    /// lost on the way leaves K as it was.
    fn accept(
        &mut self,
        prepared: &Prepared,
        removed: Option<usize>,
        edit: impl FnOnce(&mut SparseStiffness),
    ) -> Result<(), InverseError> {
        self.hand_over(prepared.own.as_ref(), removed)?;
        edit(&mut self.stiffness);
        Ok(())
    }

    /// Hands what is staged to the store, with the corner of new rows and the slot that goes.
    fn hand_over(
        &mut self,
        own: MatRef<'_, f64>,
        removed: Option<usize>,
    ) -> Result<(), InverseError> {
        let (block, most) = (self.stiffness.block(), self.most);
        let kept = self.kept.get_mut().unwrap_or_else(PoisonError::into_inner);
        kept.is_fresh = false;
        kept.store.accept(own)?;
        if let Some(slot) = removed {
            kept.store.remove(slot, block)?;
        }
        if kept.store.delayed() >= most.max(1) {
            kept.store.fold()?;
        }
        Ok(())
    }

    /// Adopts K after a failed update, with an inverse of its own; hands on what is no failure of
    /// the update.
    fn start_afresh(
        &mut self,
        cause: InverseError,
        edit: impl FnOnce(&mut SparseStiffness),
    ) -> Result<(), InverseError> {
        if matches!(cause, InverseError::Storage { .. }) {
            return Err(cause);
        }
        let mut stiffness = self.stiffness.clone();
        edit(&mut stiffness);
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
        kept.is_fresh = true;
        Ok(())
    }

    /// X with K X = F by refinement from `start`; where C no longer helps it is replaced, once.
    fn refined(
        &self,
        load: &Panel,
        start: impl Fn(&mut S) -> Result<Mat<f64>, InverseError>,
    ) -> Result<Panel, InverseError> {
        loop {
            let mut kept = self.lock();
            let is_fresh = kept.is_fresh;
            let name = kept.store.method();
            let first = Panel::from_matrix(start(&mut kept.store)?.as_ref());
            let multiply = |x: &Panel| {
                let product = kept.store.multiply(x.to_matrix().as_ref())?;
                Ok(Panel::from_matrix(product.as_ref()))
            };
            match refine_columns(name, &self.stiffness, &self.tally, load, first, multiply) {
                Err(InverseError::NotRefined { .. }) if !is_fresh => {}
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
fn small_algebra<E: Stored>(
    change: &LowRank<'_>,
    block: &Mat<f64>,
    negative: usize,
) -> Result<(Terms, f64), InverseError> {
    let u = change.beside(Mat::zeros(block.nrows(), 0).as_ref());
    let own = block * &u;
    let root = match negative {
        0 => SignedRoot::definite::<E>(change, own.as_ref())?,
        _ => SignedRoot::quasi_definite::<E>(change, own.as_ref())?,
    };
    let signs = root.signs.iter().map(|sign| -sign).collect();
    let (w, at_ring) = (&u * &root.root, own * &root.root);
    Ok((Terms { w, signs, at_ring }, root.softening))
}

impl<S: DenseStore> InverseMaintainer for Delayed<S> {
    fn name(&self) -> &'static str {
        self.lock().store.method()
    }

    fn place(&self) -> Option<String> {
        self.lock().store.place()
    }

    fn vertices(&self) -> usize {
        self.stiffness.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        &self.stiffness
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.stiffness.check_split(change)?;
        let edit = |k: &mut SparseStiffness| k.apply_split(change);
        match self.prepare_split(change) {
            Ok(prepared) => self.accept(&prepared, None, edit)?,
            Err(cause) => self.start_afresh(cause, edit)?,
        }
        Ok(self.stiffness.vertices() - 1)
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        self.update_all(updates)
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.stiffness.check_merge(slot, change)?;
        let last = self.vertices() - 1;
        let edit = |k: &mut SparseStiffness| _ = k.apply_merge(slot, change);
        match self.prepare_merge(slot, change) {
            Ok(prepared) => self.accept(&prepared, Some(slot), edit)?,
            Err(cause) => self.start_afresh(cause, edit)?,
        }
        Ok((slot != last).then_some(last))
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.stiffness.check_change(change)?;
        let edit = |k: &mut SparseStiffness| k.apply_change(change);
        match self.prepare_low_rank(&change.slots, &change.low_rank(), 0..0) {
            Ok(prepared) => self.accept(&prepared, None, edit),
            Err(cause) => self.start_afresh(cause, edit),
        }
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let rows = self.stiffness.dofs();
        check_vector("f", f, rows)?;
        check_length("u", u, rows)?;
        let times =
            |store: &mut S, x: &[f64]| store.multiply(MatRef::from_column_major_slice(x, rows, 1));
        if S::Scalar::REFINED {
            let load = Panel::from_columns(rows, &[f]);
            self.refined(&load, |store| times(store, f))?.copy_column(0, u);
            return Ok(());
        }
        let store = &mut self.lock().store;
        let mut solution: Vec<f64> = times(store, f)?.col_as_slice(0).to_vec();
        let refined = refine_once(&self.stiffness, f, &mut solution, |x| {
            let product = times(store, x)?;
            x.copy_from_slice(product.col_as_slice(0));
            Ok(())
        })?;
        self.tally.refined(usize::from(refined));
        u.copy_from_slice(&solution);
        Ok(())
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        let rows = self.rows(slots);
        if !S::Scalar::REFINED {
            return self.lock().store.columns(&rows);
        }
        let mut load = Panel::zeros(self.stiffness.dofs(), rows.len());
        rows.iter().enumerate().for_each(|(k, &row)| load.set(row, k, 1.0));
        Ok(self.refined(&load, |store| store.columns(&rows))?.to_matrix())
    }

    fn holds_columns(&self) -> bool {
        // What is refined is a solution for every column.
        !S::Scalar::REFINED
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.replace_by(&self.stiffness)
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        let name = self.name();
        let mut failure = None;
        let drift = kept_drift(&self.stiffness, seed, |at| {
            self.lock().store.columns(at).unwrap_or_else(|error| {
                failure = Some(error);
                Mat::zeros(self.stiffness.dofs(), at.len())
            })
        });
        if let Some(error) = failure {
            return Err(error);
        }
        if is_too_far(name, drift, S::Scalar::DRIFT_LIMIT) {
            self.rebuild()?;
            self.tally.rebuilt_for_drift();
        }
        Ok(drift)
    }

    fn counts(&self) -> Counts {
        self.tally.counts()
    }
}
