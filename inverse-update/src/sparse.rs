//! `sparse`: a block LDLᵀ of K, newest vertex first, kept by low-rank walks along its tree.

mod bennett;
mod compliance;
mod cover;
mod dissection;
mod edit;
mod factor;
mod numeric;
mod pattern;
mod pivot;
mod rebase;
mod strip;
mod substitution;
mod sweep;
mod symbolic;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use faer::{Mat, MatRef};

use crate::change::{check_length, check_range, check_vector};
use crate::counts::Tally;
use crate::drift::{DRIFT_LIMIT, is_too_far, kept_drift};
use crate::residual::refine_once;
use crate::{
    Counts, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, Update,
    check_loads,
};
use bennett::Scratch;
use edit::Edit;
use pattern::Pattern;
use pivot::BadPivot;
use rebase::{Based, Rebase};
use substitution::TOGETHER;

/// The most rows per vertex that the kernels are made for.
const MOST_ROWS: usize = 4;

/// A pivot that has come down by this factor has lost digits that a factor made afresh would have.
const SOFTENED: f64 = 1e4;

/// Operations of a walk relative to those of a fresh factor, before there was any.
const TYPICAL_WALK: f64 = 0.1;

/// What a fresh factor takes per operation of its own and, for its order, per vertex, and what an
/// update takes beside its walk, per cube of its columns: as operations of walks in the same time,
/// measured.
const FRESH_OPERATION: f64 = 0.6;
const FRESH_VERTEX: f64 = 5e4;
const UPDATE_COLUMNS: f64 = 150.0;

/// When the factor of [`Sparse`] gets a fresh elimination order: by these limits, or as soon as a
/// pivot has softened so much (stiff tissue gone from a soft place) that digits were lost.
///
/// New vertices are eliminated before all others and so join branches of the elimination tree that
/// the order had kept apart: after a hundred splits in one place a walk comes by most of the
/// factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RebaseOptions {
    /// Updates after which it does, and at least so many from the snapshot of K to the adoption of
    /// its factor.
    pub updates: usize,
    /// The number of blocks relative to the start, above which it does.
    pub growth: f64,
    /// Operations of updates from the snapshot to the adoption, relative to those that the last
    /// fresh factor took: time for a thread to be ready. The adoption waits for a factor that is
    /// late, so that results do not depend on how long it takes.
    pub patience: f64,
    /// Whether a thread makes the fresh factor; if not, all the work is done at the adoption.
    pub background: bool,
}

impl Default for RebaseOptions {
    fn default() -> Self {
        Self { updates: 24, growth: 1.3, patience: 4.0, background: true }
    }
}

/// Keeps K = L D Lᵀ, in blocks of up to 4 rows, over a nested dissection of the vertices' places.
///
/// A new vertex is eliminated first. A split is then one signed low-rank pass with the columns of
/// M = F Fᵀ − b A22⁻¹ bᵀ along one path of the elimination tree, and one new leaf column
/// (D = A22, L = a12 A22⁻¹). The merge of a vertex whose ring is eliminated after it drops its
/// column and makes the pass with −M; that of any other vertex deletes its row, which adds
/// l D lᵀ of its column, and makes one pass with that, −M and −a12 A22⁻¹ a12ᵀ.
///
/// A batch with more work than a fresh factor takes gets one.
///
/// Works for positive definite matrices and for quasi-definite ones
/// ([`SparseStiffness::quasi_definite`]); a pivot of the wrong sign, or one that has lost half of
/// its digits, makes it start afresh from K, which [`Counts`] tell.
///
/// Cost in 3-D: O(n^(4/3)) per update and O(n^(4/3)) per solve, as many numbers, held twice: to
/// return to what was held before an update that fails.
/// # Source
/// Bennett, Triangular factors of modified matrices, Numer. Math. 7, 1965; Davis, Hager,
/// Multiple-rank modifications of a sparse Cholesky factorization, SIAM J. Matrix Anal. Appl.
/// 22(4), 2001, and Row modifications of a sparse Cholesky factorization, 26(3), 2005.
pub struct Sparse {
    stiffness: SparseStiffness,
    based: Based,
    /// What was in use before, to be freed by another thread.
    old: Option<Based>,
    /// All edits since the base, to make the factor again if one damages it.
    journal: Vec<Arc<Edit>>,
    /// A fresh factor on its way.
    rebase: Option<Pending>,
    options: RebaseOptions,
    /// Of the walks on `based`, its loss as well.
    scratch: Scratch,
    rebases: usize,
    tally: Tally,
}

/// A fresh factor on its way.
struct Pending {
    rebase: Rebase,
    /// The length of the journal, and the operations of walks so far, at its snapshot.
    snapshot: usize,
    operations: f64,
    /// Whether the next edit is the last that it is waited for.
    is_ripe: bool,
}

impl Sparse {
    /// Orders and factors `stiffness`, with the default [`RebaseOptions`].
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced;
    /// [`InverseError::BlockTooLarge`] for more than 4 rows per vertex.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        Self::with_options(stiffness, RebaseOptions::default())
    }

    /// As [`new`](Self::new), with other options.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_options(
        stiffness: SparseStiffness,
        options: RebaseOptions,
    ) -> Result<Self, InverseError> {
        let block = stiffness.block();
        if block > MOST_ROWS {
            let (method, limit) = ("sparse", MOST_ROWS);
            return Err(InverseError::BlockTooLarge { method, block, limit });
        }
        let based = fresh(&stiffness)?;
        Ok(Self {
            stiffness,
            based,
            old: None,
            journal: Vec::new(),
            rebase: None,
            options,
            scratch: Scratch::default(),
            rebases: 0,
            tally: Tally::default(),
        })
    }

    /// Solutions that took a step of refinement because their residual was above
    /// [`REFINEMENT_LIMIT`](crate::REFINEMENT_LIMIT).
    #[must_use]
    pub fn refinements(&self) -> usize {
        self.tally.counts().refinement_steps
    }

    /// Fresh elimination orders adopted in the course of work; not counted as rebuilds.
    #[must_use]
    pub fn rebases(&self) -> usize {
        self.rebases
    }

    /// Blocks of L and D, zeros of the panels included.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.based.factor.blocks
    }

    /// Changes the factor, then K; if the factor can't follow, it is made anew from the new K.
    fn update(
        &mut self,
        edit: Result<Edit, InverseError>,
        apply: impl Fn(&mut SparseStiffness),
    ) -> Result<(), InverseError> {
        let cause = match edit.map(Arc::new) {
            Ok(edit) => match self.follow(&edit) {
                Ok(()) => {
                    apply(&mut self.stiffness);
                    if self.rebase.is_none() && self.is_due() {
                        self.start_rebase();
                    }
                    return Ok(());
                }
                Err(bad) => bad.into_error("the changed stiffness", 0, 0),
            },
            Err(cause) => cause,
        };
        let mut stiffness = self.stiffness.clone();
        apply(&mut stiffness);
        match fresh(&stiffness) {
            Ok(based) => {
                tracing::warn!(%cause, "sparse: update refused, factor computed afresh");
                self.stiffness = stiffness;
                self.adopt(based, Vec::new());
                self.tally.rebuilt_for_pivot();
                Ok(())
            }
            Err(error) => {
                self.based.restore(&self.journal, &mut self.scratch);
                Err(error)
            }
        }
    }

    /// Walks on the factor, or has the walk made on a fresh one that is ready and takes its place.
    fn follow(&mut self, edit: &Arc<Edit>) -> Result<(), BadPivot> {
        if let Some(mut pending) = self.rebase.take_if(|pending| pending.is_ripe) {
            pending.rebase.push(edit);
            // The old factor is as right as ever: without a fresh one it goes on.
            if let Some(based) = pending.rebase.finish() {
                let mut journal = self.journal.split_off(pending.snapshot);
                journal.push(Arc::clone(edit));
                self.adopt(based, journal);
                self.rebases += 1;
                return Ok(());
            }
        }
        self.based.apply(edit, &mut self.scratch)?;
        self.journal.push(Arc::clone(edit));
        if let Some(pending) = &mut self.rebase {
            pending.rebase.push(edit);
            let wanted = self.options.patience * self.based.operations;
            pending.is_ripe = self.journal.len() + 1 - pending.snapshot >= self.options.updates
                && self.scratch.operations - pending.operations >= wanted;
        }
        Ok(())
    }

    /// K⁻¹ of the columns of `loads` as the factor gives it, [`TOGETHER`] at a time.
    fn unrefined(&self, loads: MatRef<'_, f64>) -> Mat<f64> {
        let mut solutions = Mat::zeros(loads.nrows(), loads.ncols());
        for first in (0..loads.ncols()).step_by(TOGETHER) {
            let group = first..(first + TOGETHER).min(loads.ncols());
            let load = |j: usize| loads.col(j).iter().copied().collect();
            let mut sides: Vec<Vec<f64>> = group.clone().map(load).collect();
            let mut all: Vec<&mut [f64]> = sides.iter_mut().map(Vec::as_mut_slice).collect();
            self.based.factor.solve(&mut all);
            for (j, side) in group.zip(&sides) {
                solutions.col_as_slice_mut(j).copy_from_slice(side);
            }
        }
        solutions
    }

    /// Refines a solution once if its residual asks for it.
    fn refine(&self, load: &[f64], solution: &mut [f64]) -> Result<(), InverseError> {
        let refined = refine_once(&self.stiffness, load, solution, |x| {
            self.based.factor.solve(&mut [x]);
            Ok(())
        })?;
        self.tally.refined(usize::from(refined));
        Ok(())
    }

    /// Columns of the identity by row number.
    fn units(&self, at: &[usize]) -> Mat<f64> {
        Mat::from_fn(self.stiffness.dofs(), at.len(), |i, j| if i == at[j] { 1.0 } else { 0.0 })
    }

    #[cfg(test)]
    pub(crate) fn spoil(&mut self, fraction: f64) {
        let values = self.based.factor.panels.iter_mut().flat_map(|panel| &mut panel.pivots);
        values.for_each(|value| *value *= 1.0 + fraction);
    }

    fn adopt(&mut self, based: Based, journal: Vec<Arc<Edit>>) {
        self.old = Some(std::mem::replace(&mut self.based, based));
        self.journal = journal;
        self.rebase = None;
        self.scratch.forget();
    }

    fn start_rebase(&mut self) {
        let pattern = Pattern::of(&self.stiffness);
        self.rebase = Some(Pending {
            rebase: Rebase::start(pattern, self.options.background, self.old.take()),
            snapshot: self.journal.len(),
            operations: self.scratch.operations,
            is_ripe: false,
        });
    }

    /// Whether updates would take longer than a fresh factor, given the walks and their operations
    /// before the batch.
    fn is_many(&self, updates: &[Update], before: (usize, f64)) -> bool {
        let mean = |(walks, operations): (usize, f64)| operations / walks.max(1) as f64;
        let all = (self.scratch.walks, self.scratch.operations);
        let walk = match all.0 {
            0 => TYPICAL_WALK * self.based.operations,
            // Walks of a batch are alike: a few tell what the others will take.
            _ => mean(all).max(mean((all.0 - before.0, all.1 - before.1))),
        };
        let fresh = FRESH_OPERATION * self.based.operations
            + FRESH_VERTEX * self.stiffness.vertices() as f64;
        let block = self.stiffness.block();
        let columns = updates.iter().map(|update| (update.most_columns(block) as f64).powi(3));
        updates.len() as f64 * walk + UPDATE_COLUMNS * columns.sum::<f64>() > fresh
    }

    /// K after all updates, and its factor.
    fn afresh_after(
        &mut self,
        updates: &[Update],
    ) -> Result<(SparseStiffness, Based), InverseError> {
        // The new factor can have its memory: to get more from the system takes as long as half of
        // the work.
        self.old = None;
        let mut stiffness = self.stiffness.clone();
        updates.iter().try_for_each(|update| stiffness.update(update))?;
        let based = fresh(&stiffness)?;
        Ok((stiffness, based))
    }

    fn is_due(&self) -> bool {
        let limit = self.options.growth * self.based.blocks as f64;
        self.journal.len() >= self.options.updates
            || self.based.factor.blocks as f64 > limit
            || self.scratch.loss > SOFTENED
    }
}

/// The order in which a fresh [`Sparse`] eliminates the vertices of `stiffness`, first to go first:
/// nested dissection where they have places, minimum degree where they have none.
///
/// For whoever factors K by other means. Cost: O(n log n) and some hundred edges per vertex.
#[must_use]
pub fn elimination_order(stiffness: &SparseStiffness) -> Vec<usize> {
    dissection::order(&Pattern::of(stiffness))
}

/// A factor from K alone.
fn fresh(stiffness: &SparseStiffness) -> Result<Based, InverseError> {
    let block = stiffness.block();
    Based::new(&Pattern::of(stiffness))
        .map_err(|bad: BadPivot| bad.into_error("the stiffness", bad.position, block))
}

impl InverseMaintainer for Sparse {
    fn name(&self) -> &'static str {
        "sparse"
    }

    fn vertices(&self) -> usize {
        self.stiffness.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        &self.stiffness
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.stiffness.check_split(change)?;
        let edit = Edit::split(change, self.stiffness.negative());
        self.update(edit, |k| k.apply_split(change))?;
        Ok(self.vertices() - 1)
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.stiffness.check_merge(slot, change)?;
        let last = self.vertices() - 1;
        let edit = Edit::merge(slot, change, self.stiffness.negative());
        self.update(edit, |k| _ = k.apply_merge(slot, change))?;
        Ok((slot != last).then_some(last))
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.stiffness.check_change(change)?;
        self.update(Ok(Edit::change(change)), |k| k.apply_change(change))
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        let before = (self.scratch.walks, self.scratch.operations);
        let mut is_walked = false;
        for (done, update) in updates.iter().enumerate() {
            if !is_walked && self.is_many(&updates[done..], before) {
                if let Ok((stiffness, based)) = self.afresh_after(&updates[done..]) {
                    self.stiffness = stiffness;
                    self.adopt(based, Vec::new());
                    self.rebases += 1;
                    return Ok(());
                }
                // Walks say which update is to blame, or find a way after all.
                is_walked = true;
            }
            update.make(self).map_err(|source| InverseError::in_batch(done, source))?;
        }
        Ok(())
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let rows = self.stiffness.dofs();
        check_vector("f", f, rows)?;
        check_length("u", u, rows)?;
        let mut solution = f.to_vec();
        self.based.factor.solve(&mut [&mut solution]);
        self.refine(f, &mut solution)?;
        u.copy_from_slice(&solution);
        Ok(())
    }

    fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        check_loads(&self.stiffness, loads)?;
        let mut solutions = self.unrefined(loads);
        for (j, load) in loads.col_iter().enumerate() {
            let load: Vec<f64> = load.iter().copied().collect();
            self.refine(&load, solutions.col_as_slice_mut(j))?;
        }
        Ok(solutions)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        let block = self.stiffness.block();
        let rows: Vec<usize> = slots.iter().flat_map(|&s| block * s..block * (s + 1)).collect();
        self.solve_many(self.units(&rows).as_ref())
    }

    fn compliance(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        Ok(self.based.factor.compliance(slots))
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        let based = fresh(&self.stiffness)?;
        self.adopt(based, Vec::new());
        Ok(())
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        let drift = kept_drift(&self.stiffness, seed, |at| self.unrefined(self.units(at).as_ref()));
        if is_too_far(self.name(), drift, DRIFT_LIMIT) {
            self.rebuild()?;
            self.tally.rebuilt_for_drift();
        }
        Ok(drift)
    }

    fn counts(&self) -> Counts {
        self.tally.counts()
    }
}
