//! The maintainer: the factor of K as it was, the patch of what has changed, and the factor that takes the place of
//! both.

use std::sync::atomic::{AtomicU64, Ordering};

use faer::{Mat, MatRef};

use super::krylov;
use super::patch::{Far, Patch};
use super::since::Since;
use crate::InverseError;
use crate::change::{Update, UpdateRef};
use crate::maintained::{Maintained, Method};
use crate::maintainer::{InverseMaintainer, Load, reply_by_two};
use crate::matrix::{FreshRows, SparseStiffness};
use crate::sparse::{BadPivot, Based, FRESH_OPERATION, FRESH_VERTEX, MOST_ROWS, Pattern, Rebase};

/// When the factor of [`TwoLevel`] is replaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoLevelOptions {
    /// The part of the vertices that a patch may have; where more have changed, K is factored at once.
    pub most: f64,
    /// The work between the snapshot of K and the adoption of its factor, relative to that of making it: the time
    /// that a thread has. The adoption waits for a factor that is late, so that results do not depend on how long
    /// it takes.
    pub patience: f64,
    /// Whether a thread makes the new factor; if not, all the work is done at the adoption.
    pub background: bool,
}

impl Default for TwoLevelOptions {
    fn default() -> Self {
        Self { most: 0.5, patience: 1.0, background: true }
    }
}

/// Keeps a factor of K as it was some updates ago, and one of the *patch*: K on the vertices whose rows have changed
/// since, and one layer of their neighbours.
///
/// One cycle solves for the patch, for the others by the old factor, and for the patch again. That is a symmetric
/// preconditioner, off by what the new elements of the patch change of the stiffness that the others feel behind the
/// layer. [`precondition`](InverseMaintainer::precondition)
/// is one cycle; [`solve`](InverseMaintainer::solve) makes as many, between products with K, as a solution takes (GMRES,
/// since pressures make K indefinite), four to twenty.
///
/// An update costs a new factor of the patch, those of a batch one in all. A thread meanwhile makes a new factor of the
/// whole, which is adopted after a fixed amount of work; what has changed since its snapshot is the next patch. Where more
/// than half of the vertices would be in a patch, K is factored at once.
///
/// Whether K is still definite is seen on the patch: a body that comes loose beyond it is refused by the solution that
/// follows, which then finds no end, not by the update.
///
/// Cost in 3-D with p vertices in the patch: O(p²) per update, O(n^(4/3) + p^(4/3)) per cycle, as many numbers.
/// # Source
/// Chen, Nochetto, Xu, Optimal multilevel methods for graded bisection grids, Numer. Math. 120, 2012; Toselli, Widlund,
/// Domain decomposition methods, 2005.
pub type TwoLevel = Maintained<TwoLevelMethod>;

/// See [`TwoLevel`].
#[derive(Default)]
pub struct TwoLevelMethod {
    far: Based,
    since: Since,
    patch: Patch,
    next: Option<Pending>,
    options: TwoLevelOptions,
    /// Work done so far, in operations of a factor's update.
    work: AtomicU64,
    adopted: usize,
}

/// A new factor of all of K, being made.
struct Pending {
    rebase: Rebase,
    /// From its snapshot on.
    since: Since,
    /// The work that was done before.
    work: u64,
}

impl TwoLevel {
    /// As [`new`](Self::new), with other options.
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_options(
        stiffness: SparseStiffness,
        options: TwoLevelOptions,
    ) -> Result<Self, InverseError> {
        Self::by(TwoLevelMethod { options, ..TwoLevelMethod::default() }, stiffness)
    }

    /// New factors of all of K adopted in the course of work; not counted as rebuilds.
    #[must_use]
    pub fn adopted(&self) -> usize {
        self.read(|method| method.adopted)
    }

    /// Vertices of the patch.
    #[must_use]
    pub fn patch(&self) -> usize {
        self.read(|method| method.patch.slots.len())
    }

    /// Makes a batch with one new patch; nothing is done where that fails.
    fn update_together(
        &mut self,
        updates: &[Update],
        rows: Option<&FreshRows>,
    ) -> Result<(), InverseError> {
        let mut k = self.stiffness.clone();
        match rows {
            Some(rows) => k.arrange(updates, rows)?,
            None => updates.iter().try_for_each(|update| k.update(update))?,
        }
        self.method().follow(&k, updates.iter().map(Update::borrowed))?;
        self.stiffness = k;
        Ok(())
    }

    fn update_all(
        &mut self,
        updates: &[Update],
        rows: Option<&FreshRows>,
    ) -> Result<(), InverseError> {
        if self.update_together(updates, rows).is_ok() {
            return Ok(());
        }
        // One after the other tells which one fails.
        Update::make_all(updates, self)?;
        rows.map_or(Ok(()), |rows| self.refresh(rows))
    }
}

impl TwoLevelMethod {
    fn far(&self, is_rough: bool) -> Far<'_> {
        Far { factor: &self.far.factor, since: &self.since, is_rough }
    }

    fn cycle(&self, f: &[f64], u: &mut [f64], is_rough: bool) {
        let size = (self.far.factor.block as f64).powi(2);
        let far = 2.0 * size * self.far.factor.blocks as f64;
        self.has_done(far + self.patch.multiplications());
        self.patch.cycle(&self.far(is_rough), f, u);
    }

    fn has_done(&self, work: f64) {
        self.work.fetch_add(work as u64, Ordering::Relaxed);
    }

    /// Goes on to another K, that of some updates. After an error it is as before.
    fn follow<'a>(
        &mut self,
        k: &SparseStiffness,
        updates: impl Iterator<Item = UpdateRef<'a>> + Clone,
    ) -> Result<(), InverseError> {
        let followed = |since: &Since| {
            let mut since = since.clone();
            updates.clone().for_each(|update| since.follow(update));
            let slots = Patch::slots_of(k, &since);
            let is_small = slots.len() as f64 <= self.options.most * k.vertices() as f64;
            (since, is_small.then_some(slots))
        };
        let (since, slots) = followed(&self.since);
        let later = self.next.as_ref().map(|next| followed(&next.since));
        let is_wanted =
            slots.is_none() || self.next.as_ref().is_some_and(|next| self.is_ripe(next));
        if let Some((later, Some(slots))) = &later
            && is_wanted
            // The factor of before goes on where there is no other.
            && let Some(far) = self.next.take().and_then(|next| next.rebase.finish())
        {
            self.patch = self.made(Patch::new(k, slots.clone()), k)?;
            (self.far, self.since) = (far, later.clone());
            self.adopted += 1;
        } else if let Some(slots) = slots {
            self.patch = self.made(Patch::new(k, slots), k)?;
            self.since = since;
            if let (Some(next), Some((later, _))) = (&mut self.next, later) {
                next.since = later;
            }
        } else {
            return self.invert(k);
        }
        if self.next.is_none() {
            let rebase = Rebase::start(Pattern::of(k), self.options.background, None);
            let (since, work) = (Since::start(k.vertices()), self.work.load(Ordering::Relaxed));
            self.next = Some(Pending { rebase, since, work });
        }
        Ok(())
    }

    /// Whether a thread has had the time to make a factor as large as that in use.
    fn is_ripe(&self, next: &Pending) -> bool {
        let made = (self.work.load(Ordering::Relaxed) - next.work) as f64;
        made >= self.options.patience * making(self.far.operations, self.far.factor.vertices())
    }

    /// A patch, or what K lacks of one.
    fn made(
        &self,
        patch: Result<Patch, BadPivot>,
        k: &SparseStiffness,
    ) -> Result<Patch, InverseError> {
        let patch = patch
            .map_err(|bad| bad.into_error("the changed stiffness", bad.position, k.block()))?;
        self.has_done(making(patch.operations, patch.slots.len()));
        Ok(patch)
    }
}

/// The work of a factor that takes so many operations, of so many vertices.
fn making(operations: f64, vertices: usize) -> f64 {
    FRESH_OPERATION * operations + FRESH_VERTEX * vertices as f64
}

impl Method for TwoLevelMethod {
    const SHOWS_KEPT_COLUMNS: bool = false;
    const CAN_DRIFT: bool = false;

    fn name(&self) -> &'static str {
        "two_level"
    }

    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError> {
        let block = k.block();
        if block > MOST_ROWS {
            let (method, limit) = ("two_level", MOST_ROWS);
            return Err(InverseError::BlockTooLarge { method, block, limit });
        }
        let far = Based::new(&Pattern::of(k))
            .map_err(|bad| bad.into_error("the stiffness", bad.position, block))?;
        let since = Since::start(k.vertices());
        let patch = self.made(Patch::new(k, Vec::new()), k)?;
        *self = Self { far, since, patch, next: None, ..std::mem::take(self) };
        Ok(())
    }

    fn update(&mut self, k: &SparseStiffness, update: UpdateRef<'_>) -> Result<(), InverseError> {
        let mut k = k.clone();
        k.apply_update(update);
        self.follow(&k, std::iter::once(update))
    }

    fn multiply(&self, k: &SparseStiffness, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        if self.since == Since::start(self.far.factor.vertices()) {
            return Ok(self.far.factor.solve_columns(x));
        }
        let mut solutions = Mat::zeros(x.nrows(), x.ncols());
        for (j, column) in x.col_iter().enumerate() {
            let load: Vec<f64> = column.iter().copied().collect();
            let solution = krylov::solve(k, &load, |f, u| self.cycle(f, u, false));
            solutions.col_as_slice_mut(j).copy_from_slice(&solution);
        }
        Ok(solutions)
    }

    fn precondition(
        whole: &Maintained<Self>,
        f: &[f64],
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        whole.read(|method| method.cycle(f, u, true));
        Ok(())
    }

    fn precondition_and_reply(
        whole: &Maintained<Self>,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        reply_by_two(|f, u| Self::precondition(whole, f, u), f, rows, reply, u)
    }

    fn compliance(whole: &Maintained<Self>, loads: &[Load]) -> Result<Mat<f64>, InverseError> {
        let mut sides = Mat::<f64>::zeros(whole.stiffness.dofs(), loads.len());
        for (side, load) in loads.iter().enumerate() {
            load.iter().for_each(|&(row, force)| sides[(row, side)] += force);
        }
        let felt = sides.transpose() * whole.solve_many(sides.as_ref())?;
        Ok(Mat::from_fn(loads.len(), loads.len(), |i, j| 0.5 * (felt[(i, j)] + felt[(j, i)])))
    }

    fn rough_compliance(
        whole: &Maintained<Self>,
        loads: &[Load],
    ) -> Result<Mat<f64>, InverseError> {
        Ok(whole.read(|method| method.patch.compliance(&method.far(true), loads)))
    }

    fn batch(whole: &mut Maintained<Self>, updates: &[Update]) -> Result<(), InverseError> {
        whole.update_all(updates, None)
    }

    fn batch_to(
        whole: &mut Maintained<Self>,
        updates: &[Update],
        rows: &FreshRows,
    ) -> Result<(), InverseError> {
        whole.update_all(updates, Some(rows))
    }
}

#[cfg(test)]
mod tests;
