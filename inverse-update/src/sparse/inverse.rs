//! The maintainer: the current factor, the edits since it was made, and the factor with a fresh
//! elimination order that replaces it from time to time.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use faer::{Mat, MatRef};

use super::bennett::Scratch;
use super::dissection;
use super::edit::Edit;
use super::factor::NONE;
use super::pattern::Pattern;
use super::pivot::BadPivot;
use super::rebase::{Based, Rebase};
use crate::InverseError;
use crate::change::{Update, UpdateRef};
use crate::maintained::{Maintained, Method};
use crate::maintainer::{InverseMaintainer, Load};
use crate::matrix::{FreshRows, SparseStiffness};

/// The most rows per vertex that the kernels are made for.
pub(crate) const MOST_ROWS: usize = 4;

/// A pivot that has become this many times smaller has lost digits that a new factor would have.
const SOFTENED: f64 = 1e4;

/// The operations of an update of the factor relative to those of a new factor, assumed until one
/// was measured.
const TYPICAL_WALK: f64 = 0.1;

/// Measured times in units of one operation of a walk (an update along its path of the elimination
/// tree): a new factor per operation of its own and per vertex, with a new order and with that of before; the small
/// algebra of an update per square of its columns.
pub(crate) const FRESH_OPERATION: f64 = 0.6;
pub(crate) const FRESH_VERTEX: f64 = 5e4;
const INHERITED_VERTEX: f64 = 3e4;
const UPDATE_COLUMNS: f64 = 4e3;

/// Updates that take as long as a new factor that a batch makes itself once it is due.
const FEW: f64 = 8.0;

/// When the factor of [`Sparse`] is replaced by one with a fresh elimination order: by these
/// limits, or as soon as a pivot has become so small (stiff tissue removed from soft) that digits
/// were lost.
///
/// New vertices are eliminated before all others and so join branches of the elimination tree that
/// the order had kept apart: after a hundred splits in one place an update visits most of the
/// factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RebaseOptions {
    /// Updates after which a new factor is started, and the least number of updates from its
    /// snapshot of K to its adoption.
    pub updates: usize,
    /// The growth of the number of blocks above which a new factor is started.
    pub growth: f64,
    /// Operations of updates from the snapshot to the adoption, relative to those of the last new
    /// factor: the time that a thread has. The adoption waits for a factor that is late, so that
    /// results do not depend on how long it takes.
    pub patience: f64,
    /// Whether a thread makes the new factor; if not, all the work is done at the adoption.
    pub background: bool,
}

impl Default for RebaseOptions {
    fn default() -> Self {
        Self { updates: 16, growth: 1.3, patience: 2.0, background: true }
    }
}

/// Keeps K = L D Lᵀ, in blocks of up to 4 rows, over a nested dissection of the vertices'
/// positions.
///
/// A new vertex is eliminated first. A split is then one signed low-rank pass with the columns of
/// M = F Fᵀ − b A22⁻¹ bᵀ along one path of the elimination tree, and one new leaf column
/// (D = A22, L = a12 A22⁻¹). The merge of a vertex whose ring is eliminated after it drops its
/// column and makes the pass with −M; that of any other vertex deletes its row, which adds
/// l D lᵀ of its column, and makes one pass with that, −M and −a12 A22⁻¹ a12ᵀ.
///
/// A batch that would take longer than a new factor gets one, in the order of the factor before: a new vertex is placed
/// beside one that has its neighbours. A new order is found where that would take [`growth`](RebaseOptions::growth) times
/// the operations that the last one took, for the square of the vertices.
///
/// Whoever preconditions with it reads L in f32 where that is a hundredth off at most in the norm
/// of energy, which is measured of each new factor.
///
/// Works for positive definite matrices and for quasi-definite ones
/// ([`SparseStiffness::quasi_definite`]); a pivot of the wrong sign, or one that has lost half of
/// its digits, makes it factor K from scratch.
///
/// Cost in 3-D: O(n^(4/3)) per update and O(n^(4/3)) per solve, as many numbers, stored
/// twice: to return to the state before an update that fails.
/// # Source
/// Bennett, Triangular factors of modified matrices, Numer. Math. 7, 1965; Davis, Hager,
/// Multiple-rank modifications of a sparse Cholesky factorization, SIAM J. Matrix Anal. Appl.
/// 22(4), 2001, and Row modifications of a sparse Cholesky factorization, 26(3), 2005.
pub type Sparse = Maintained<SparseMethod>;

/// See [`Sparse`].
#[derive(Default)]
pub struct SparseMethod {
    based: Based,
    /// The factor in use before, to be freed by another thread.
    old: Option<Based>,
    /// All edits since the base, to reproduce the factor if one damages it.
    journal: Vec<Arc<Edit>>,
    /// A factor with a fresh elimination order, being made.
    rebase: Option<Pending>,
    options: RebaseOptions,
    /// Whether updates come in batches now.
    is_batched: bool,
    /// What the order of the factor says of the next K that is factored.
    ranks: Option<Vec<u32>>,
    /// Working memory and statistics of the walks on `based`.
    scratch: Scratch,
    rebases: usize,
}

/// A factor with a fresh elimination order, being made.
struct Pending {
    rebase: Rebase,
    /// The length of the journal, and the operations of walks so far, at its snapshot.
    snapshot: usize,
    operations: f64,
    /// Whether to adopt it at the next edit.
    is_ripe: bool,
}

impl Sparse {
    /// As [`new`](Self::new), with other options.
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_options(
        stiffness: SparseStiffness,
        options: RebaseOptions,
    ) -> Result<Self, InverseError> {
        Self::by(SparseMethod { options, ..SparseMethod::default() }, stiffness)
    }

    /// Fresh elimination orders adopted in the course of work; not counted as rebuilds.
    #[must_use]
    pub fn rebases(&self) -> usize {
        self.read(|method| method.rebases)
    }
}

impl SparseMethod {
    /// Makes an edit of the factor, or on the new one that now takes its place.
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

    fn adopt(&mut self, based: Based, journal: Vec<Arc<Edit>>) {
        self.old = Some(std::mem::replace(&mut self.based, based));
        self.journal = journal;
        self.rebase = None;
        self.scratch.forget();
    }

    /// What an update takes, given the number of walks and their operations before the batch, and what a new factor
    /// takes, in operations of walks.
    fn costs(&self, k: &SparseStiffness, before: (usize, f64)) -> (f64, f64) {
        let mean = |(walks, operations): (usize, f64)| operations / walks.max(1) as f64;
        let all = (self.scratch.walks, self.scratch.operations);
        let walk = match all.0 {
            0 => TYPICAL_WALK * self.based.operations,
            // Walks of a batch are alike: a few tell what the others will take.
            _ => mean(all).max(mean((all.0 - before.0, all.1 - before.1))),
        };
        let vertices = INHERITED_VERTEX * k.vertices() as f64;
        (walk, FRESH_OPERATION * self.based.operations + vertices)
    }

    /// Whether updates would take longer than a new factor.
    fn is_many(&self, k: &SparseStiffness, updates: &[Update], before: (usize, f64)) -> bool {
        let (walk, fresh) = self.costs(k, before);
        let square = |update: &Update| (update.borrowed().most_columns(k.block()) as f64).powi(2);
        let columns: f64 = updates.iter().map(square).sum();
        updates.len() as f64 * walk + UPDATE_COLUMNS * columns > fresh
    }

    /// Whether the next batch gets a new factor, whatever its length: one is due, and takes no longer than a few updates.
    /// A thread would take more from who works meanwhile.
    fn is_renewed_soon(&self, k: &SparseStiffness) -> bool {
        let (walk, fresh) = self.costs(k, (0, 0.0));
        self.is_due() && fresh <= FEW * walk
    }

    /// When the vertices of the factor are eliminated, by the slots they have after some updates.
    fn ranks_after(&self, updates: &[Update]) -> Vec<u32> {
        let mut ranks = self.based.ranks();
        for update in updates {
            match (update.borrowed(), update.borrowed().removed()) {
                (UpdateRef::Content(_), _) => {}
                (_, Some(slot)) => _ = ranks.swap_remove(slot),
                _ => ranks.push(NONE),
            }
        }
        ranks
    }

    fn is_due(&self) -> bool {
        let limit = self.options.growth * self.based.blocks as f64;
        self.journal.len() >= self.options.updates
            || self.based.factor.blocks as f64 > limit
            || self.scratch.loss > SOFTENED
    }
}

/// The order in which a new [`Sparse`] eliminates the vertices of `stiffness`: nested dissection
/// where they have positions, minimum degree where they have none.
///
/// For callers that factor K by other means. Cost: O(n log n) and some hundred edges per vertex.
#[must_use]
pub fn elimination_order(stiffness: &SparseStiffness) -> Vec<usize> {
    dissection::order(&Pattern::of(stiffness))
}

impl Method for SparseMethod {
    const SHOWS_KEPT_COLUMNS: bool = false;

    fn name(&self) -> &'static str {
        "sparse"
    }

    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError> {
        let block = k.block();
        if block > MOST_ROWS {
            let (method, limit) = ("sparse", MOST_ROWS);
            return Err(InverseError::BlockTooLarge { method, block, limit });
        }
        let pattern = Pattern::of(k);
        let based = match self.ranks.take() {
            Some(ranks) => self.based.renewed(&pattern, &ranks, self.options.growth),
            None => Based::new(&pattern),
        };
        let based = based.map_err(|bad| bad.into_error("the stiffness", bad.position, block))?;
        self.adopt(based, Vec::new());
        Ok(())
    }

    fn update(&mut self, k: &SparseStiffness, update: UpdateRef<'_>) -> Result<(), InverseError> {
        let edit = Arc::new(Edit::of(update, k.negative())?);
        self.follow(&edit).map_err(|bad| bad.into_error("the changed stiffness", 0, 0))
    }

    fn updated(&mut self, k: &SparseStiffness) {
        if self.rebase.is_none() && self.is_due() && !(self.is_batched && self.is_renewed_soon(k)) {
            let background = self.options.background;
            self.rebase = Some(Pending {
                rebase: Rebase::start(Pattern::of(k), background, self.old.take()),
                snapshot: self.journal.len(),
                operations: self.scratch.operations,
                is_ripe: false,
            });
        }
    }

    fn restore(&mut self) {
        self.based.restore(&self.journal, &mut self.scratch);
    }

    fn multiply(&self, _: &SparseStiffness, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        Ok(self.based.factor.solve_columns(x))
    }

    fn precondition(
        whole: &Maintained<Self>,
        f: &[f64],
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        u.copy_from_slice(f);
        whole.read(|method| method.based.factor.precondition(u));
        Ok(())
    }

    fn compliance(whole: &Maintained<Self>, loads: &[Load]) -> Result<Mat<f64>, InverseError> {
        Ok(whole.read(|method| method.based.factor.compliance(loads)))
    }

    fn rough_compliance(
        whole: &Maintained<Self>,
        loads: &[Load],
    ) -> Result<Mat<f64>, InverseError> {
        Ok(whole.read(|method| method.based.factor.rough_compliance(loads)))
    }

    fn apply_and_reply(
        whole: &Maintained<Self>,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        u.copy_from_slice(f);
        whole.read(|method| method.based.factor.solve_with_reply(u, rows, reply));
        Ok(())
    }

    fn precondition_and_reply(
        whole: &Maintained<Self>,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        u.copy_from_slice(f);
        whole.read(|method| method.based.factor.precondition_with_reply(u, rows, reply));
        Ok(())
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

impl Sparse {
    /// Makes a batch, to `rows` of K if they are known.
    fn update_all(
        &mut self,
        updates: &[Update],
        rows: Option<&FreshRows>,
    ) -> Result<(), InverseError> {
        self.method().is_batched = true;
        let done = self.update_in_turn(updates, rows);
        self.method().is_batched = false;
        done
    }

    fn update_in_turn(
        &mut self,
        updates: &[Update],
        rows: Option<&FreshRows>,
    ) -> Result<(), InverseError> {
        let scratch = &self.method().scratch;
        let before = (scratch.walks, scratch.operations);
        let k = &self.stiffness;
        let mut is_walked = false;
        let is_due = self.read(|method| method.is_renewed_soon(k));
        for (done, update) in updates.iter().enumerate() {
            let rest = &updates[done..];
            let is_many = |method: &SparseMethod| method.is_many(&self.stiffness, rest, before);
            if !is_walked && (is_due || self.read(is_many)) {
                // The new factor can have its memory: to get more from the system takes as long as
                // half of the work.
                self.method().old = None;
                let mut k = self.stiffness.clone();
                let changed = match rows {
                    Some(rows) => k.arrange(rest, rows),
                    None => rest.iter().try_for_each(|update| k.update(update)),
                };
                let method = self.method();
                method.ranks = Some(method.ranks_after(rest));
                if changed.is_ok() && self.replace(k).is_ok() {
                    self.method().rebases += 1;
                    return Ok(());
                }
                // One update after the other: that tells which one fails, or succeeds.
                is_walked = true;
            }
            update.make(self).map_err(|source| InverseError::in_batch(done, source))?;
        }
        rows.map_or(Ok(()), |rows| self.refresh(rows))
    }
}
