//! `sparse`: a block LDLᵀ of K, newest vertex first, kept by low-rank walks along its tree.

mod bennett;
mod cover;
mod dissection;
mod edit;
mod factor;
mod numeric;
mod pattern;
mod pivot;
mod rebase;
mod substitution;
mod symbolic;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use faer::Mat;

use crate::change::{check_length, check_range, check_vector};
use crate::{
    Counts, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange,
};
use bennett::Scratch;
use edit::Edit;
use pattern::Pattern;
use pivot::BadPivot;
use rebase::{Based, Rebase};
use substitution::TOGETHER;

/// The most rows per vertex that the kernels are made for.
const MOST_ROWS: usize = 4;

/// The relative residual of a solution above which it is refined once.
pub const REFINEMENT_LIMIT: f64 = 1e-11;

/// When the factor of [`Sparse`] gets a fresh elimination order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RebaseOptions {
    /// Updates after which it does: the newest vertices, all in front, lengthen the paths.
    pub updates: usize,
    /// The number of blocks relative to the start, above which it does.
    pub growth: f64,
    /// Updates from the snapshot of K to the adoption of its factor. The adoption waits for a
    /// factor that is late, so that results do not depend on how long it takes.
    pub delay: usize,
    /// Whether a thread makes the fresh factor; if not, all the work is done at the adoption.
    pub background: bool,
}

impl Default for RebaseOptions {
    fn default() -> Self {
        Self { updates: 100, growth: 1.3, delay: 50, background: true }
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
    /// All edits since the base, to make the factor again if one damages it.
    journal: Vec<Arc<Edit>>,
    /// A fresh factor on its way, and the length of the journal at its snapshot.
    rebase: Option<(Rebase, usize)>,
    options: RebaseOptions,
    scratch: Scratch,
    rebuilds: usize,
    rebases: usize,
    refinements: AtomicUsize,
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
            journal: Vec::new(),
            rebase: None,
            options,
            scratch: Scratch::default(),
            rebuilds: 0,
            rebases: 0,
            refinements: AtomicUsize::new(0),
        })
    }

    /// Solutions that took a step of refinement because their residual was above
    /// [`REFINEMENT_LIMIT`].
    #[must_use]
    pub fn refinements(&self) -> usize {
        self.refinements.load(Ordering::Relaxed)
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
        let cause = match edit {
            Ok(edit) => match self.based.factor.apply(&edit, &mut self.scratch) {
                Ok(()) => {
                    apply(&mut self.stiffness);
                    self.note(Arc::new(edit));
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
                self.rebuilds += 1;
                Ok(())
            }
            Err(error) => {
                self.restore();
                Err(error)
            }
        }
    }

    /// Makes the factor again as it was, to the last bit: the same edits of the same base.
    fn restore(&mut self) {
        self.based.factor = (*self.based.base).clone();
        for edit in &self.journal {
            let again = self.based.factor.apply(edit, &mut self.scratch);
            debug_assert!(again.is_ok(), "the same edits went well before");
        }
    }

    fn adopt(&mut self, based: Based, journal: Vec<Arc<Edit>>) {
        self.based = based;
        self.journal = journal;
        self.rebase = None;
    }

    /// Enters an edit in the journal; starts and adopts re-bases.
    fn note(&mut self, edit: Arc<Edit>) {
        if let Some((rebase, _)) = &mut self.rebase {
            rebase.push(&edit);
        }
        self.journal.push(edit);
        match self.rebase.take() {
            Some((rebase, snapshot)) if self.journal.len() - snapshot >= self.options.delay => {
                // The old factor is as right as ever: without a fresh one it goes on.
                if let Some(based) = rebase.finish() {
                    let journal = self.journal.split_off(snapshot);
                    self.adopt(based, journal);
                    self.rebases += 1;
                }
            }
            Some(running) => self.rebase = Some(running),
            None if self.is_due() => {
                let pattern = Pattern::of(&self.stiffness);
                let rebase = Rebase::start(pattern, self.options.background);
                self.rebase = Some((rebase, self.journal.len()));
            }
            None => {}
        }
    }

    fn is_due(&self) -> bool {
        let limit = self.options.growth * self.based.base.blocks as f64;
        self.journal.len() >= self.options.updates || self.based.factor.blocks as f64 > limit
    }
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

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let rows = self.stiffness.dofs();
        check_vector("f", f, rows)?;
        check_length("u", u, rows)?;
        u.copy_from_slice(f);
        self.based.factor.solve(&mut [&mut *u]);
        let mut residual = vec![0.0; rows];
        self.stiffness.apply(u, &mut residual)?;
        residual.iter_mut().zip(f).for_each(|(r, f)| *r = f - *r);
        let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        if square(&residual) > REFINEMENT_LIMIT * REFINEMENT_LIMIT * square(f) {
            self.based.factor.solve(&mut [&mut residual]);
            u.iter_mut().zip(&residual).for_each(|(u, correction)| *u += correction);
            self.refinements.fetch_add(1, Ordering::Relaxed);
        }
        Ok(())
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        let block = self.stiffness.block();
        let mut columns = Mat::<f64>::zeros(self.stiffness.dofs(), block * slots.len());
        for j in 0..columns.ncols() {
            columns[(block * slots[j / block] + j % block, j)] = 1.0;
        }
        let all: Vec<usize> = (0..columns.ncols()).collect();
        for group in all.chunks(TOGETHER) {
            let mut sides: Vec<Vec<f64>> =
                group.iter().map(|&j| columns.col_as_slice(j).to_vec()).collect();
            let mut parts: Vec<&mut [f64]> = sides.iter_mut().map(|s| s.as_mut_slice()).collect();
            self.based.factor.solve(&mut parts);
            for (&j, side) in group.iter().zip(&sides) {
                columns.col_as_slice_mut(j).copy_from_slice(side);
            }
        }
        Ok(columns)
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        let based = fresh(&self.stiffness)?;
        self.adopt(based, Vec::new());
        Ok(())
    }

    fn counts(&self) -> Counts {
        let (rebuilds, refinement_steps) = (self.rebuilds, self.refinements());
        Counts { rebuilds, failed_pivots: rebuilds, refinement_steps }
    }
}
