//! C in packed tiles, and the updates of it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::accuracy::{Counts, Tally, is_too_far, kept_drift, refine_each, solve_refined};
use crate::change::{RingChange, StiffnessChange, Update, UpdateRef};
use crate::dense::from_stiffness::symmetric_inverse;
use crate::dense::precision::Precision;
use crate::dense::refinement::refine_columns;
use crate::dense::tiles::{Deferred, Panel, SignedPanel};
use crate::maintainer::{InverseMaintainer, maintained};
use crate::matrix::{SparseStiffness, check_length, check_range, check_vector};

/// The dense inverse in f64: scene name `woodbury`.
pub type Woodbury = PackedInverse<f64>;

/// The dense inverse in f32, half the memory and the time per pass: scene name `woodbury_f32`.
///
/// The small algebra of updates is in f64. Every solution and every column is refined by K in f64
/// ([`REFINED_RESIDUAL`](crate::REFINED_RESIDUAL)); if that fails the inverse is rebuilt from K.
pub type WoodburyF32 = PackedInverse<f32>;

/// Columns of updates deferred in a batch before a pass over C adds them.
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
/// maintainer rebuild C from K, which [`Counts`] tell.
///
/// A batch of updates gathers up to 96 columns Y before the pass, and corrects by them what it
/// reads of C in the meantime.
///
/// Cost: O(n²(3 + q)) per update, O(n²) per solve, n²/2 stored numbers.
/// # Source
/// Hager, Updating the inverse of a matrix, SIAM Review 31(2), 1989; Vanderbei, Symmetric
/// quasidefinite matrices, SIAM J. Optimization 5(1), 1995; McDaniel et al., Delayed Slater
/// determinant update algorithms, J. Chem. Phys. 147, 2017.
pub struct PackedInverse<E: Precision> {
    pub(super) stiffness: SparseStiffness,
    /// Nothing is deferred between calls. Behind a lock so that a solution that can't be refined
    /// may replace C.
    inverse: RwLock<Deferred<E>>,
    tally: Tally,
    /// Whether C was computed from K since the last update.
    is_rebuilt: AtomicBool,
}

/// What an update adds to C.
pub(super) struct Prepared {
    pub(super) terms: SignedPanel,
    /// C_:m and C_mm of the vertex that is added, without columns where none is.
    pub(super) coupling: Panel,
    pub(super) own: Mat<f64>,
}

impl<E: Precision> PackedInverse<E> {
    /// Inverts `stiffness`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        let inverse = RwLock::new(from_stiffness(&stiffness)?);
        let (tally, is_rebuilt) = (Tally::default(), AtomicBool::new(true));
        Ok(Self { stiffness, inverse, tally, is_rebuilt })
    }

    #[cfg(test)]
    pub(crate) fn spoil(&mut self, fraction: f64) {
        self.inverse_mut().scale_rows(3, 1.0 + fraction);
    }

    pub(super) fn inverse(&self) -> RwLockReadGuard<'_, Deferred<E>> {
        // C is replaced as a whole or changed by updates that can't panic half-way.
        self.inverse.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn inverse_mut(&mut self) -> &mut Deferred<E> {
        self.inverse.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes an update. Unless `at_once`, the pass over C is left to a later flush.
    fn update_deferred(
        &mut self,
        update: UpdateRef<'_>,
        at_once: bool,
    ) -> Result<(), InverseError> {
        self.stiffness.check(update)?;
        let Prepared { terms, coupling, own } = match self.prepare(update) {
            Ok(prepared) => prepared,
            Err(cause) => return self.rebuild_after(&cause, update),
        };
        self.stiffness.apply_update(update);
        *self.is_rebuilt.get_mut() = false;
        let block = self.stiffness.block();
        let inverse = self.inverse_mut();
        inverse.defer(terms);
        if let Some(slot) = update.removed() {
            inverse.swap_remove(slot, block);
        }
        if at_once {
            inverse.flush();
        }
        inverse.append(&coupling, own.as_ref());
        Ok(())
    }

    fn update(&mut self, update: UpdateRef<'_>) -> Result<(), InverseError> {
        self.update_deferred(update, true)
    }

    /// Makes an update whose small factor failed: K changes and is inverted from scratch.
    fn rebuild_after(
        &mut self,
        cause: &InverseError,
        update: UpdateRef<'_>,
    ) -> Result<(), InverseError> {
        let mut stiffness = self.stiffness.clone();
        stiffness.apply_update(update);
        *self.inverse_mut() = from_stiffness(&stiffness)?;
        tracing::warn!(%cause, "{}: update refused, inverse computed afresh", E::METHOD);
        self.stiffness = stiffness;
        self.tally.rebuilt_for_pivot();
        *self.is_rebuilt.get_mut() = true;
        Ok(())
    }

    /// X with K X = F, from `start` by X ← X + C (F − K X). A C with which that fails is rebuilt,
    /// once.
    ///
    /// The norm is scaled by the diagonal, so that neither units nor soft tissue beside stiff
    /// tissue decide which rows count. Cost: O(n² k) per step.
    /// # Errors
    /// [`InverseError::NotRefined`] if a rebuilt C does not help either;
    /// [`InverseError::NotFinite`] on overflow.
    fn refined(
        &self,
        load: &Panel,
        start: impl Fn(&Deferred<E>) -> Panel,
    ) -> Result<Panel, InverseError> {
        loop {
            let is_rebuilt = self.is_rebuilt.load(Ordering::Relaxed);
            let attempt = {
                let inverse = self.inverse();
                let first = start(&inverse);
                let multiply = |x: &Panel| Ok(inverse.multiply(x));
                refine_columns(E::METHOD, &self.stiffness, &self.tally, load, first, multiply)
            };
            if is_rebuilt || attempt.is_ok() {
                return attempt;
            }
            self.rebuild_for_refinement()?;
        }
    }

    /// Replaces a C that no longer helps, once: another thread may have done so already.
    fn rebuild_for_refinement(&self) -> Result<(), InverseError> {
        let mut inverse = self.inverse.write().unwrap_or_else(PoisonError::into_inner);
        if !self.is_rebuilt.load(Ordering::Relaxed) {
            *inverse = from_stiffness(&self.stiffness)?;
            self.is_rebuilt.store(true, Ordering::Relaxed);
            self.tally.rebuilt();
            tracing::warn!("{}: refinement failed, inverse computed afresh", E::METHOD);
        }
        Ok(())
    }

    fn kept_drift(&self, seed: u64) -> Result<f64, InverseError> {
        Ok(kept_drift(&self.stiffness, seed, |at| self.inverse().gather(at)))
    }

    /// x ← C x.
    fn multiply_vector(&self, x: &mut [f64]) -> Result<(), InverseError> {
        self.inverse().multiply(&Panel::from_columns(x.len(), &[x])).copy_column(0, x);
        Ok(())
    }
}

fn from_stiffness<E: Precision>(stiffness: &SparseStiffness) -> Result<Deferred<E>, InverseError> {
    Ok(Deferred::from_lower(symmetric_inverse(stiffness)?.as_ref()))
}

impl<E: Precision> InverseMaintainer for PackedInverse<E> {
    maintained!(E::DRIFT_LIMIT);

    fn name(&self) -> &'static str {
        E::METHOD
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        for (done, update) in updates.iter().enumerate() {
            let made = self.update_deferred(update.borrowed(), false);
            if made.is_err() || self.inverse().pending() >= DEFERRED {
                self.inverse_mut().flush();
            }
            made.map_err(|source| InverseError::in_batch(done, source))?;
        }
        self.inverse_mut().flush();
        Ok(())
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        if !E::REFINED {
            let k = &self.stiffness;
            return solve_refined(k, &self.tally, (f, u), |x| self.multiply_vector(x));
        }
        let rows = self.stiffness.dofs();
        check_vector("f", f, rows)?;
        check_length("u", u, rows)?;
        let load = Panel::from_columns(rows, &[f]);
        self.refined(&load, |inverse| inverse.multiply(&load))?.copy_column(0, u);
        Ok(())
    }

    fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        self.stiffness.check_loads(loads)?;
        let panel = Panel::from_matrix(loads);
        if E::REFINED {
            return Ok(self.refined(&panel, |inverse| inverse.multiply(&panel))?.to_matrix());
        }
        let mut solutions = self.inverse().multiply(&panel).to_matrix();
        let both = (loads, &mut solutions);
        refine_each(&self.stiffness, &self.tally, both, |x| self.multiply_vector(x))?;
        Ok(solutions)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        let rows = self.stiffness.rows_of(slots);
        if !E::REFINED {
            return Ok(self.inverse().gather(&rows));
        }
        let load = Panel::from_matrix(self.stiffness.unit_columns(&rows).as_ref());
        let one = Mat::<f64>::identity(rows.len(), rows.len());
        let start = |inverse: &Deferred<E>| inverse.select_times(&rows, one.as_ref());
        Ok(self.refined(&load, start)?.to_matrix())
    }

    fn holds_columns(&self) -> bool {
        // What is refined is a solution for every column.
        !E::REFINED
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        *self.inverse_mut() = from_stiffness(&self.stiffness)?;
        *self.is_rebuilt.get_mut() = true;
        Ok(())
    }
}
