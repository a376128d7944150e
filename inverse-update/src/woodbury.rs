//! `woodbury`, `woodbury_f32`: low-rank updates in the factors of the change, one fused pass over
//! half of C.

mod prepare;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use faer::{Mat, MatRef};

use crate::change::{check_length, check_range, check_vector};
use crate::counts::Tally;
use crate::drift::{is_too_far, kept_drift};
use crate::fresh::symmetric_inverse;
use crate::panel::Panel;
use crate::residual::refine_once;
use crate::stored::Stored;
use crate::tiles::{SignedPanel, Tiles};
use crate::{
    Counts, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, Update,
    check_loads,
};
use prepare::Prepared;

/// The dense inverse in f64: scene name `woodbury`.
pub type Woodbury = PackedInverse<f64>;

/// The dense inverse in f32, half the memory and the time per pass: scene name `woodbury_f32`.
///
/// The small algebra of updates is in f64. Every solution and every column is refined by K in f64
/// ([`REFINED_RESIDUAL`](crate::REFINED_RESIDUAL)); if that fails the inverse is computed afresh.
pub type WoodburyF32 = PackedInverse<f32>;

/// Columns of updates put off in a batch, before a pass over C adds them.
const DEFERRED: usize = 96;

/// Keeps C = K⁻¹ dense, lower half only, by symmetric low-rank updates.
///
/// Eliminating the new vertex leaves K + F Fᵀ − b A22⁻¹ bᵀ = K + U Λ Uᵀ on the old rows, U = (P N)
/// without what cancels between stiff and soft tissue, Λ = diag(1, −1), so a split is
/// 1. Z = C_:r U, Λ + Uᵀ Z_r = L Σ Lᵀ, Y = Z L⁻ᵀ, C ← C − Y Σ Yᵀ,
/// 2. T = −A22⁻¹ a12ᵀ, C_m: = T C_r:, C_mm = A22⁻¹ + T C_rr Tᵀ,
///
/// and a merge the same in reverse. All of it is computed on the ring's columns first; then C is
/// read and written once. For a quasi-definite K the factor is one by eigenvectors, with the
/// signature of Λ. A factor that fails (nearly singular change, another signature) makes the
/// maintainer start afresh from K, which [`Counts`] tell.
///
/// A batch of updates gathers up to 96 columns Y before the pass, and corrects by them what it
/// reads of C in the meantime.
///
/// Cost: O(n²(3 + q)) per update, O(n²) per solve, n²/2 stored numbers.
/// # Source
/// Hager, Updating the inverse of a matrix, SIAM Review 31(2), 1989; Vanderbei, Symmetric
/// quasidefinite matrices, SIAM J. Optimization 5(1), 1995; McDaniel et al., Delayed Slater
/// determinant update algorithms, J. Chem. Phys. 147, 2017.
pub struct PackedInverse<E: Stored> {
    pub(crate) stiffness: SparseStiffness,
    /// Behind a lock so that a solution that can't be refined may replace it.
    inverse: RwLock<Tiles<E>>,
    /// What C lacks: C − `pending` is the inverse. Nothing between calls.
    pending: SignedPanel,
    pub(crate) tally: Tally,
    /// Whether nothing happened since C was computed from K.
    pub(crate) is_fresh: AtomicBool,
}

impl<E: Stored> PackedInverse<E> {
    /// Inverts `stiffness`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        let inverse = fresh(&stiffness)?;
        Ok(Self {
            pending: SignedPanel::none(stiffness.dofs()),
            stiffness,
            inverse: RwLock::new(inverse),
            tally: Tally::default(),
            is_fresh: AtomicBool::new(true),
        })
    }

    #[cfg(test)]
    pub(crate) fn spoil(&mut self, fraction: f64) {
        self.tiles_mut().scale_rows(3, 1.0 + fraction);
    }

    pub(crate) fn tiles(&self) -> RwLockReadGuard<'_, Tiles<E>> {
        // Tiles are replaced whole or changed by updates that can't panic half-way.
        self.inverse.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn tiles_mut(&mut self) -> &mut Tiles<E> {
        self.inverse.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces a C that no longer helps, once: another thread may have done so already.
    pub(crate) fn replace(&self) -> Result<(), InverseError> {
        let mut tiles = self.inverse.write().unwrap_or_else(PoisonError::into_inner);
        if !self.is_fresh.load(Ordering::Relaxed) {
            *tiles = fresh(&self.stiffness)?;
            self.is_fresh.store(true, Ordering::Relaxed);
            self.tally.rebuilt();
            tracing::warn!("{}: refinement failed, inverse computed afresh", E::METHOD);
        }
        Ok(())
    }

    /// Adopts K after a failed update, with an inverse of its own.
    fn start_afresh(
        &mut self,
        cause: &InverseError,
        edit: impl FnOnce(&mut SparseStiffness),
    ) -> Result<(), InverseError> {
        let mut stiffness = self.stiffness.clone();
        edit(&mut stiffness);
        *self.tiles_mut() = fresh(&stiffness)?;
        tracing::warn!(%cause, "{}: update refused, inverse computed afresh", E::METHOD);
        self.pending = SignedPanel::none(stiffness.dofs());
        self.stiffness = stiffness;
        self.tally.rebuilt_for_pivot();
        *self.is_fresh.get_mut() = true;
        Ok(())
    }

    /// One step of refinement, if the residual asks for it.
    fn refine(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let refined = refine_once(&self.stiffness, f, u, |x| {
            self.tiles().multiply(&Panel::from_columns(f.len(), &[x])).copy_column(0, x);
            Ok(())
        })?;
        self.tally.refined(usize::from(refined));
        Ok(())
    }

    /// Splits. Unless `at_once`, the pass over C is left pending.
    fn split_with(&mut self, change: &RingChange, at_once: bool) -> Result<usize, InverseError> {
        self.stiffness.check_split(change)?;
        match self.prepare_split(change) {
            Ok(Prepared { terms, border }) => {
                self.stiffness.apply_split(change);
                self.defer(terms);
                if at_once {
                    // Before there are new rows: terms are 0 there.
                    self.flush();
                }
                if let Some((coupling, own)) = border {
                    // The new rows are those of the whole sum.
                    self.tiles_mut().append(&coupling, own.as_ref());
                    self.pending.columns.grow(own.nrows());
                }
            }
            Err(cause) => self.start_afresh(&cause, |k| k.apply_split(change))?,
        }
        Ok(self.stiffness.vertices() - 1)
    }

    /// As [`split_with`](Self::split_with).
    fn merge_with(
        &mut self,
        slot: usize,
        change: &RingChange,
        at_once: bool,
    ) -> Result<Option<usize>, InverseError> {
        self.stiffness.check_merge(slot, change)?;
        let last = self.vertices() - 1;
        match self.prepare_merge(slot, change) {
            Ok(Prepared { terms, .. }) => {
                let block = self.stiffness.block();
                self.stiffness.apply_merge(slot, change);
                self.defer(terms);
                self.tiles_mut().swap_remove(slot, block);
                self.pending.columns.swap_remove(slot, block);
                if at_once {
                    self.flush();
                }
            }
            Err(cause) => self.start_afresh(&cause, |k| _ = k.apply_merge(slot, change))?,
        }
        Ok((slot != last).then_some(last))
    }

    /// As [`split_with`](Self::split_with).
    fn change_with(&mut self, change: &StiffnessChange, at_once: bool) -> Result<(), InverseError> {
        self.stiffness.check_change(change)?;
        match self.prepare_low_rank(&change.slots, &change.low_rank(), 0..0) {
            Ok(Prepared { terms, .. }) => {
                self.stiffness.apply_change(change);
                self.defer(terms);
                if at_once {
                    self.flush();
                }
                Ok(())
            }
            Err(cause) => self.start_afresh(&cause, |k| k.apply_change(change)),
        }
    }

    fn defer(&mut self, terms: SignedPanel) {
        *self.is_fresh.get_mut() = false;
        self.pending = if self.pending.signs.is_empty() { terms } else { self.pending.and(&terms) };
    }

    /// Adds what is pending to C: the pass.
    fn flush(&mut self) {
        let none = SignedPanel::none(self.pending.columns.rows());
        let pending = std::mem::replace(&mut self.pending, none);
        self.tiles_mut().add(&pending);
    }
}

fn fresh<E: Stored>(stiffness: &SparseStiffness) -> Result<Tiles<E>, InverseError> {
    Ok(Tiles::from_lower(symmetric_inverse(stiffness)?.as_ref()))
}

impl<E: Stored> InverseMaintainer for PackedInverse<E> {
    fn name(&self) -> &'static str {
        E::METHOD
    }

    fn vertices(&self) -> usize {
        self.stiffness.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        &self.stiffness
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.split_with(change, true)
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.merge_with(slot, change, true)
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.change_with(change, true)
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        for (done, update) in updates.iter().enumerate() {
            let made = match update {
                Update::Split(change) => self.split_with(change, false).map(drop),
                Update::Merge { slot, change } => self.merge_with(*slot, change, false).map(drop),
                Update::Change(change) => self.change_with(change, false),
            };
            if made.is_err() || self.pending.signs.len() >= DEFERRED {
                self.flush();
            }
            made.map_err(|source| InverseError::in_batch(done, source))?;
        }
        self.flush();
        Ok(())
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let rows = self.stiffness.dofs();
        check_vector("f", f, rows)?;
        check_length("u", u, rows)?;
        let load = Panel::from_columns(rows, &[f]);
        if E::REFINED {
            self.refined(&load, |tiles| tiles.multiply(&load))?.copy_column(0, u);
            return Ok(());
        }
        let mut solution = vec![0.0; rows];
        self.tiles().multiply(&load).copy_column(0, &mut solution);
        self.refine(f, &mut solution)?;
        u.copy_from_slice(&solution);
        Ok(())
    }

    fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        check_loads(&self.stiffness, loads)?;
        let (rows, count) = loads.shape();
        let given: Vec<Vec<f64>> = loads.col_iter().map(|f| f.iter().copied().collect()).collect();
        let columns: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
        let panel = Panel::from_columns(rows, &columns);
        let product = if E::REFINED {
            self.refined(&panel, |tiles| tiles.multiply(&panel))?
        } else {
            self.tiles().multiply(&panel)
        };
        let mut solutions = Mat::zeros(rows, count);
        for (j, f) in given.iter().enumerate() {
            let solution = solutions.col_as_slice_mut(j);
            product.copy_column(j, solution);
            if !E::REFINED {
                self.refine(f, solution)?;
            }
        }
        Ok(solutions)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        let rows = self.rows(slots);
        if !E::REFINED {
            return Ok(self.tiles().gather(&rows));
        }
        let mut load = Panel::zeros(self.stiffness.dofs(), rows.len());
        rows.iter().enumerate().for_each(|(k, &row)| load.set(row, k, 1.0));
        let one = Mat::<f64>::identity(rows.len(), rows.len());
        let solution = self.refined(&load, |tiles| tiles.select_times(&rows, one.as_ref()))?;
        Ok(solution.at_rows(&(0..solution.rows()).collect::<Vec<_>>()))
    }

    fn holds_columns(&self) -> bool {
        // What is refined is a solution for every column.
        !E::REFINED
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        *self.tiles_mut() = fresh(&self.stiffness)?;
        *self.is_fresh.get_mut() = true;
        Ok(())
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        let drift = kept_drift(&self.stiffness, seed, |at| self.tiles().gather(at));
        if is_too_far(E::METHOD, drift, E::DRIFT_LIMIT) {
            self.rebuild()?;
            self.tally.rebuilt_for_drift();
        }
        Ok(drift)
    }

    fn counts(&self) -> Counts {
        self.tally.counts()
    }
}
