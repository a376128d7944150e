//! The maintainers of this crate as one type: K, the counts, refinement by K, and what happens
//! where an update fails, around a method that keeps the inverse.

use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::accuracy::{DRIFT_LIMIT, is_too_far, refine_columns, refine_each, watched_drift};
use crate::change::{RingChange, StiffnessChange, Update, UpdateRef};
use crate::maintainer::{Counts, InverseMaintainer, Load, compliance_by_columns, reply_by_two};
use crate::matrix::{FreshRows, SparseStiffness, check_length, check_range, check_vector};

/// How an inverse is kept: as a dense C, or as a factor of K. K itself is passed in.
pub trait Method: Send + Sized {
    /// Drift above which a rebuild is due.
    const DRIFT_LIMIT: f64 = DRIFT_LIMIT;

    /// Whether what is kept can be worse after many updates than if it had been made from K at once.
    const CAN_DRIFT: bool = true;

    /// Whether solutions are refined to more digits than are kept.
    const REFINED: bool = false;

    /// Whether columns are read as they are kept; if not, they are refined as solutions are.
    const SHOWS_KEPT_COLUMNS: bool = !Self::REFINED;

    /// See [`InverseMaintainer::name`].
    fn name(&self) -> &'static str;

    /// See [`InverseMaintainer::place`].
    fn place(&self) -> Option<String> {
        None
    }

    /// See [`InverseMaintainer::holds_columns`].
    fn holds_columns(&self) -> bool {
        Self::SHOWS_KEPT_COLUMNS
    }

    /// Inverts K from scratch; after an error what there is stays.
    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError>;

    /// Follows an update that K can take, and has not taken yet. After an error, unless it is
    /// [`InverseError::Storage`], K is inverted from scratch.
    fn update(&mut self, k: &SparseStiffness, update: UpdateRef<'_>) -> Result<(), InverseError>;

    /// Called once K has taken the update.
    fn updated(&mut self, _k: &SparseStiffness) {}

    /// Called where neither the update nor the inversion succeeded: what the update damaged comes back.
    fn restore(&mut self) {}

    /// C X as it is kept; fails with [`InverseError::Storage`] alone.
    fn multiply(&self, k: &SparseStiffness, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>;

    /// Columns of C as they are kept, by row number; fails as [`multiply`](Self::multiply).
    fn columns(&self, k: &SparseStiffness, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.multiply(k, k.unit_columns(rows).as_ref())
    }

    /// See [`InverseMaintainer::precondition`]; sides are checked.
    fn precondition(
        whole: &Maintained<Self>,
        f: &[f64],
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        whole.apply(f, u)
    }

    /// See [`InverseMaintainer::precondition_and_reply`]; sides and rows are checked.
    fn precondition_and_reply(
        whole: &Maintained<Self>,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        Self::apply_and_reply(whole, f, rows, reply, u)
    }

    /// See [`InverseMaintainer::compliance`]; rows are checked.
    fn compliance(whole: &Maintained<Self>, loads: &[Load]) -> Result<Mat<f64>, InverseError> {
        compliance_by_columns(whole, loads)
    }

    /// See [`InverseMaintainer::rough_compliance`]; rows are checked.
    fn rough_compliance(
        whole: &Maintained<Self>,
        loads: &[Load],
    ) -> Result<Mat<f64>, InverseError> {
        Self::compliance(whole, loads)
    }

    /// See [`InverseMaintainer::apply_and_reply`]; sides and rows are checked.
    fn apply_and_reply(
        whole: &Maintained<Self>,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        reply_by_two(|f, u| whole.apply(f, u), f, rows, reply, u)
    }

    /// See [`InverseMaintainer::batch`].
    fn batch(whole: &mut Maintained<Self>, updates: &[Update]) -> Result<(), InverseError> {
        Update::make_all(updates, whole)
    }

    /// See [`InverseMaintainer::batch_to`].
    fn batch_to(
        whole: &mut Maintained<Self>,
        updates: &[Update],
        rows: &FreshRows,
    ) -> Result<(), InverseError> {
        Self::batch(whole, updates)?;
        whole.refresh(rows)
    }
}

/// An inverse that has drifted this many times as far as a fresh one is worth another rebuild.
const WORSE: f64 = 10.0;

/// Keeps K and, by one of the methods of this crate, its inverse.
///
/// Where a method can't follow an update (a nearly singular change, pivots of other signs) the new
/// K is inverted from scratch, which [`Counts`] tell.
pub struct Maintained<M> {
    pub(crate) stiffness: SparseStiffness,
    /// Behind a lock, so that a solution that can't be refined may replace the inverse.
    kept: RwLock<Kept<M>>,
    counts: Mutex<Counts>,
    /// What [`watch`](InverseMaintainer::watch) found of the inverse that it had computed last: what
    /// even a fresh one is off by where K is badly conditioned.
    fresh_drift: f64,
}

struct Kept<M> {
    method: M,
    /// Whether the inverse was computed from K since the last update.
    is_rebuilt: bool,
}

/// What is behind the lock: replaced as a whole, or changed by updates that can't panic half-way.
fn unlocked<M>(kept: &mut RwLock<Kept<M>>) -> &mut Kept<M> {
    kept.get_mut().unwrap_or_else(PoisonError::into_inner)
}

impl<M: Method> Kept<M> {
    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError> {
        self.method.invert(k)?;
        self.is_rebuilt = true;
        Ok(())
    }
}

impl<M: Method + Default> Maintained<M> {
    /// Inverts `stiffness`. Cost: O(n³); of a factor in 3-D O(n²).
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced;
    /// [`InverseError::BlockTooLarge`].
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        Self::by(M::default(), stiffness)
    }
}

impl<M: Method> Maintained<M> {
    pub(crate) fn by(mut method: M, stiffness: SparseStiffness) -> Result<Self, InverseError> {
        method.invert(&stiffness)?;
        let kept = RwLock::new(Kept { method, is_rebuilt: true });
        Ok(Self { stiffness, kept, counts: Mutex::default(), fresh_drift: 0.0 })
    }

    fn kept(&self) -> RwLockReadGuard<'_, Kept<M>> {
        self.kept.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn count(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The method, for what only it can tell or do.
    pub(crate) fn method(&mut self) -> &mut M {
        &mut unlocked(&mut self.kept).method
    }

    /// Reads of the method.
    pub(crate) fn read<T>(&self, read: impl FnOnce(&M) -> T) -> T {
        read(&self.kept().method)
    }

    /// See [`InverseMaintainer::watch`].
    fn drift(&self, seed: u64) -> Result<f64, InverseError> {
        let k = &self.stiffness;
        self.read(|m| watched_drift(k, seed, |loads| m.multiply(k, loads)))
    }

    /// A load and room for its answer.
    fn check_sides(&self, f: &[f64], u: &[f64]) -> Result<(), InverseError> {
        let rows = self.stiffness.dofs();
        check_vector("f", f, rows)?;
        check_length("u", u, rows)
    }

    /// Makes an update of any kind.
    pub(crate) fn update(&mut self, update: UpdateRef<'_>) -> Result<(), InverseError> {
        self.stiffness.check(update)?;
        let Kept { method, is_rebuilt } = unlocked(&mut self.kept);
        *is_rebuilt = false;
        match method.update(&self.stiffness, update) {
            Ok(()) => {
                self.stiffness.apply_update(update);
                method.updated(&self.stiffness);
                Ok(())
            }
            Err(error @ InverseError::Storage { .. }) => Err(error),
            Err(cause) => self.rebuild_after(&cause, update),
        }
    }

    /// Makes an update that the method can't follow.
    fn rebuild_after(
        &mut self,
        cause: &InverseError,
        update: UpdateRef<'_>,
    ) -> Result<(), InverseError> {
        let mut stiffness = self.stiffness.clone();
        stiffness.apply_update(update);
        self.replace(stiffness).inspect_err(|_| self.method().restore())?;
        tracing::warn!(%cause, "{}: update refused, inverse computed afresh", self.name());
        let mut counts = self.count();
        counts.rebuilds += 1;
        counts.failed_pivots += 1;
        Ok(())
    }

    /// Takes another K and inverts it.
    pub(crate) fn replace(&mut self, stiffness: SparseStiffness) -> Result<(), InverseError> {
        unlocked(&mut self.kept).invert(&stiffness)?;
        self.stiffness = stiffness;
        Ok(())
    }

    /// K⁻¹ of some loads, from what `start` reads, refined by K. An inverse with which that fails
    /// is computed afresh, once.
    fn solutions(
        &self,
        loads: MatRef<'_, f64>,
        start: impl Fn(&M) -> Result<Mat<f64>, InverseError>,
    ) -> Result<Mat<f64>, InverseError> {
        let k = &self.stiffness;
        loop {
            let kept = self.kept();
            let (method, mut steps) = (&kept.method, 0);
            let first = start(method)?;
            let multiply = |x: MatRef<'_, f64>| method.multiply(k, x);
            let refined = if M::REFINED {
                refine_columns(method.name(), k, loads, first, multiply, &mut steps)
                    .map(|solutions| (solutions, true))
            } else {
                refine_each(k, loads, first, multiply, &mut steps)
            };
            self.count().refinement_steps += steps;
            match refined {
                // What a fresh inverse leaves is what K's condition allows.
                Ok((solutions, are_close)) if are_close || kept.is_rebuilt => return Ok(solutions),
                Err(error)
                    if kept.is_rebuilt || !matches!(error, InverseError::NotRefined { .. }) =>
                {
                    return Err(error);
                }
                Ok(_) | Err(_) => {}
            }
            drop(kept);
            self.rebuild_for_refinement()?;
        }
    }

    /// Replaces an inverse that no longer helps, once: another thread may have done so already.
    fn rebuild_for_refinement(&self) -> Result<(), InverseError> {
        let mut kept = self.kept.write().unwrap_or_else(PoisonError::into_inner);
        if !kept.is_rebuilt {
            kept.invert(&self.stiffness)?;
            self.count().rebuilds += 1;
            tracing::warn!("{}: refinement failed, inverse computed afresh", kept.method.name());
        }
        Ok(())
    }
}

impl<M: Method> InverseMaintainer for Maintained<M> {
    fn name(&self) -> &'static str {
        self.read(M::name)
    }

    fn place(&self) -> Option<String> {
        self.read(M::place)
    }

    fn stiffness(&self) -> &SparseStiffness {
        &self.stiffness
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.update(UpdateRef::Split(change))?;
        Ok(self.stiffness.vertices() - 1)
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.update(UpdateRef::Merge(slot, change))?;
        Ok(self.stiffness.moved_into(slot))
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.update(UpdateRef::Content(change))
    }

    fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError> {
        self.stiffness.refresh(rows)?;
        unlocked(&mut self.kept).is_rebuilt = false;
        Ok(())
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        unlocked(&mut self.kept).is_rebuilt &= updates.is_empty();
        M::batch(self, updates)
    }

    fn batch_to(&mut self, updates: &[Update], rows: &FreshRows) -> Result<(), InverseError> {
        unlocked(&mut self.kept).is_rebuilt = false;
        M::batch_to(self, updates, rows)
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        self.check_sides(f, u)?;
        let load = MatRef::from_column_major_slice(f, f.len(), 1);
        let solution = self.solutions(load, |method| method.multiply(&self.stiffness, load))?;
        u.copy_from_slice(solution.col_as_slice(0));
        Ok(())
    }

    fn apply(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        if M::REFINED {
            return self.solve(f, u);
        }
        self.check_sides(f, u)?;
        let load = MatRef::from_column_major_slice(f, f.len(), 1);
        let product = self.read(|method| method.multiply(&self.stiffness, load))?;
        u.copy_from_slice(product.col_as_slice(0));
        Ok(())
    }

    fn apply_and_reply(
        &self,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        self.check_sides(f, u)?;
        check_range(rows, self.stiffness.dofs())?;
        M::apply_and_reply(self, f, rows, reply, u)
    }

    fn precondition(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        self.check_sides(f, u)?;
        M::precondition(self, f, u)
    }

    fn precondition_and_reply(
        &self,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        self.check_sides(f, u)?;
        check_range(rows, self.stiffness.dofs())?;
        M::precondition_and_reply(self, f, rows, reply, u)
    }

    fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        self.stiffness.check_loads(loads)?;
        self.solutions(loads, |method| method.multiply(&self.stiffness, loads))
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        let k = &self.stiffness;
        check_range(slots, k.vertices())?;
        let rows = k.rows_of(slots);
        if M::SHOWS_KEPT_COLUMNS {
            return self.read(|method| method.columns(k, &rows));
        }
        self.solutions(k.unit_columns(&rows).as_ref(), |method| method.columns(k, &rows))
    }

    fn compliance(&self, loads: &[Load]) -> Result<Mat<f64>, InverseError> {
        let rows: Vec<usize> = loads.iter().flatten().map(|load| load.0).collect();
        check_range(&rows, self.stiffness.dofs())?;
        M::compliance(self, loads)
    }

    fn rough_compliance(&self, loads: &[Load]) -> Result<Mat<f64>, InverseError> {
        let rows: Vec<usize> = loads.iter().flatten().map(|load| load.0).collect();
        check_range(&rows, self.stiffness.dofs())?;
        M::rough_compliance(self, loads)
    }

    fn holds_columns(&self) -> bool {
        self.read(M::holds_columns)
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        unlocked(&mut self.kept).invert(&self.stiffness)
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        if !M::CAN_DRIFT || self.kept().is_rebuilt {
            return Ok(0.0);
        }
        let drift = self.drift(seed)?;
        if is_too_far(self.name(), drift, M::DRIFT_LIMIT.max(WORSE * self.fresh_drift)) {
            self.rebuild()?;
            self.fresh_drift = self.drift(seed)?;
            let mut counts = self.count();
            counts.rebuilds += 1;
            counts.drift_rebuilds += 1;
        }
        Ok(drift)
    }

    fn counts(&self) -> Counts {
        *self.count()
    }
}

#[cfg(test)]
mod tests;
