//! The stage: what keeps C = K⁻¹ while K changes.

use std::ops::AddAssign;

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::accuracy::{DRIFT_LIMIT, drift_of_columns, is_too_far, watched_drift};
use crate::change::{RingChange, StiffnessChange, Update};
use crate::matrix::{FreshRows, SparseStiffness, check_range};

/// Forces on some rows of K, N: by row number.
pub type Load = Vec<(usize, f64)>;

/// Keeps what it takes to apply C = K⁻¹ while K changes by rings of tetrahedra.
///
/// One implementation per file; [`build`](crate::build) makes them by name. All matrices are in N/m
/// (K) and m/N (C); rows are vertex-major x, y, z. After an error the object holds what it held
/// before.
///
/// A maintainer of one's own that factors K anew after every update:
///
/// ```
/// use faer::linalg::solvers::{PartialPivLu, Solve};
/// use yawara_inverse_update::{
///     FreshRows, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange,
/// };
///
/// struct Refactored {
///     stiffness: SparseStiffness,
///     lu: PartialPivLu<f64>,
/// }
///
/// impl InverseMaintainer for Refactored {
///     fn name(&self) -> &'static str {
///         "refactored"
///     }
///     fn stiffness(&self) -> &SparseStiffness {
///         &self.stiffness
///     }
///     fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
///         let slot = self.stiffness.split(change)?;
///         self.rebuild().map(|()| slot)
///     }
///     fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
///         let moved = self.stiffness.merge(slot, change)?;
///         self.rebuild().map(|()| moved)
///     }
///     fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
///         self.stiffness.change(change)?;
///         self.rebuild()
///     }
///     fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError> {
///         self.stiffness.refresh(rows)?;
///         self.rebuild()
///     }
///     fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
///         u.copy_from_slice(f);
///         self.lu.solve_in_place(faer::ColMut::from_slice_mut(u));
///         Ok(())
///     }
///     fn rebuild(&mut self) -> Result<(), InverseError> {
///         self.lu = self.stiffness.to_dense().partial_piv_lu();
///         Ok(())
///     }
/// }
///
/// // A spring of 2 N/m to the wall; then a vertex on a spring of 3 N/m behind it.
/// let mut stiffness = SparseStiffness::zeros(1, 1)?;
/// stiffness.add(&[0], faer::mat![[2.0]].as_ref())?;
/// let lu = stiffness.to_dense().partial_piv_lu();
/// let mut inverse = Refactored { stiffness, lu };
/// let spring = faer::mat![[3.0_f64.sqrt()]];
/// let (slots, removed) = (vec![0], faer::Mat::zeros(1, 0));
/// inverse.change(&StiffnessChange { slots, added: spring, removed })?;
/// inverse.split(&RingChange::freed(vec![0], faer::mat![[-3.0]], faer::mat![[3.0]], 0)?)?;
/// let mut u = [0.0; 2];
/// inverse.solve(&[0.0, 6.0], &mut u)?;
/// assert!((u[0] - 3.0).abs() < 1e-12 && (u[1] - 5.0).abs() < 1e-12);
/// assert!(inverse.watch(0)? < 1e-12);
/// # Ok::<(), InverseError>(())
/// ```
pub trait InverseMaintainer: Send {
    /// The scene name of the method, e.g. `woodbury`.
    fn name(&self) -> &'static str;

    /// Where the inverse is stored, if not in the host's memory: the device, and the memory used
    /// there.
    fn place(&self) -> Option<String> {
        None
    }

    /// The matrix whose inverse is kept, for residuals.
    fn stiffness(&self) -> &SparseStiffness;

    /// Vertices that K has now.
    fn vertices(&self) -> usize {
        self.stiffness().vertices()
    }

    /// A vertex is added: K becomes [K + K_c − K_p, a12; a21, A22]. Returns its slot, the last.
    /// # Errors
    /// [`InverseError`] if `change` has wrong shapes, is not finite or makes K singular.
    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError>;

    /// The vertex at `slot` goes, the reverse of [`split`](Self::split) with the same
    /// `change` (`change.slots` as they are before the removal, without `slot`). Returns the
    /// slot that was moved into `slot`, if any.
    /// # Errors
    /// As [`split`](Self::split).
    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError>;

    /// The vertex at `slot` is fixed from now on: its rows and columns leave K. Returns the slot
    /// that was moved into `slot`, if any. The last vertex may be fixed too: nothing is left then.
    ///
    /// [`RingChange::freed`] gives a [`split`](Self::split) that frees it again. Cost: as a
    /// [`merge`](Self::merge), with the vertex's neighbours as the ring.
    /// # Errors
    /// [`InverseError::Slot`] if `slot` is not in `0..vertices()`.
    fn fix(&mut self, slot: usize) -> Result<Option<usize>, InverseError> {
        let change = RingChange::fixed(self.stiffness(), slot)?;
        self.merge(slot, &change)
    }

    /// The content changes, K on vertices that stay: a material edit, a removed element, a split or
    /// merge whose midpoint is fixed.
    /// # Errors
    /// As [`split`](Self::split).
    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError>;

    /// Rows of K get the values that their elements sum up to; rounding aside, K has them already. C
    /// may stay: the next [`watch`](Self::watch) finds what rounding has made of it.
    ///
    /// Cost: O(blocks of the rows).
    /// # Errors
    /// As [`SparseStiffness::refresh`].
    fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError>;

    /// u = C f; both of length `block · vertices()`.
    ///
    /// Where ‖D^(−½)(K u − f)‖ exceeds
    /// [`REFINEMENT_LIMIT`](crate::REFINEMENT_LIMIT) of ‖D^(−½) f‖, D = |diag K|, and the
    /// rounding of K u, a step of refinement is made, which [`Counts`] tell; up to
    /// [`MOST_REFINEMENTS`](crate::MOST_REFINEMENTS) where C is kept in f32. Where that leaves more than it should, C is
    /// computed afresh.
    /// Cost: a product with the sparse K on top of the method's own.
    /// # Errors
    /// [`InverseError::Shape`]; [`InverseError::NotFinite`], also if u would not be.
    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError>;

    /// u = C f as C is kept: nothing is checked by K.
    ///
    /// Where C is kept in fewer digits than a solution has, it is refined as in [`solve`](Self::solve).
    /// # Errors
    /// As [`solve`](Self::solve).
    fn apply(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        self.solve(f, u)
    }

    /// u = C (f + e) as [`apply`](Self::apply) has it, where e acts on some `rows` alone, and `reply`
    /// chooses it by what C f is there (both in the order of `rows`).
    ///
    /// Cost: two applications; one, and what is read of the rows' paths, where a factor is kept.
    /// # Errors
    /// As [`solve`](Self::solve); [`InverseError::Slot`] if a row is not one of K.
    fn apply_and_reply(
        &self,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        check_range(rows, self.stiffness().dofs())?;
        reply_by_two(|f, u| self.apply(f, u), f, rows, reply, u)
    }

    /// u ≈ C f for steps that are checked by what they leave out of balance: what it is off by may have 10⁻⁴ of the
    /// energy of u, where that makes it faster. [`TwoLevel`](crate::TwoLevel) is off by what one of its cycles leaves.
    /// Symmetric, and linear until the next update.
    /// # Errors
    /// As [`solve`](Self::solve).
    fn precondition(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        self.apply(f, u)
    }

    /// [`apply_and_reply`](Self::apply_and_reply) with the digits of [`precondition`](Self::precondition).
    /// # Errors
    /// As [`apply_and_reply`](Self::apply_and_reply).
    fn precondition_and_reply(
        &self,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        u: &mut [f64],
    ) -> Result<(), InverseError> {
        self.apply_and_reply(f, rows, reply, u)
    }

    /// U = C F for several loads, one per column of the `block · vertices()` rows of F.
    ///
    /// As [`solve`](Self::solve) for each; a maintainer may read what it keeps once for several.
    /// # Errors
    /// As [`solve`](Self::solve).
    fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        self.stiffness().check_loads(loads)?;
        let mut solutions = Mat::zeros(loads.nrows(), loads.ncols());
        for (j, load) in loads.col_iter().enumerate() {
            let load: Vec<f64> = load.iter().copied().collect();
            self.solve(&load, solutions.col_as_slice_mut(j))?;
        }
        Ok(solutions)
    }

    /// The columns of C that belong to `slots`: (block · vertices()) × (block · slots.len()).
    /// # Errors
    /// [`InverseError::Slot`] if a slot is not in `0..vertices()`.
    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        let k = self.stiffness();
        check_range(slots, k.vertices())?;
        self.solve_many(k.unit_columns(&k.rows_of(slots)).as_ref())
    }

    /// G C Gᵀ for some loads, the rows of G: what tools that push with them feel.
    ///
    /// Symmetric, loads.len()². Cost: the [columns](Self::columns) of all slots that a load acts on,
    /// unless a method has a shorter way.
    /// # Errors
    /// [`InverseError::Slot`] if a row is not in `0..block · vertices()`.
    fn compliance(&self, loads: &[Load]) -> Result<Mat<f64>, InverseError> {
        compliance_by_columns(self, loads)
    }

    /// [`compliance`](Self::compliance) with the digits of [`precondition`](Self::precondition).
    /// # Errors
    /// As [`compliance`](Self::compliance).
    fn rough_compliance(&self, loads: &[Load]) -> Result<Mat<f64>, InverseError> {
        self.compliance(loads)
    }

    /// Several updates one after the other, with slots as those before leave them.
    ///
    /// As single calls would make them. A maintainer may defer work and do it for many updates at
    /// once, or invert the last K from scratch where that is less work; the matrices in between may
    /// be singular then.
    /// # Errors
    /// [`InverseError::Batch`] tells which update was refused and why; those before it are made, as
    /// by single calls, those from it on are not.
    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        Update::make_all(updates, self)
    }

    /// A [`batch`](Self::batch), and the rows of K that it leads to: those of all vertices that an
    /// update concerns and that are left, in the slots at the end.
    ///
    /// A maintainer that inverts the last K from scratch may take that K from `rows`, and not look at
    /// what the updates say about it.
    /// # Errors
    /// As [`batch`](Self::batch) and [`refresh`](Self::refresh).
    fn batch_to(&mut self, updates: &[Update], rows: &FreshRows) -> Result<(), InverseError> {
        self.batch(updates)?;
        self.refresh(rows)
    }

    /// Whether columns of C are stored and only read. If not, C_:p w costs less as one solve with
    /// the right-hand side w than from the columns.
    fn holds_columns(&self) -> bool {
        false
    }

    /// Computes the inverse from [`stiffness`](Self::stiffness) alone.
    /// # Errors
    /// [`InverseError::Singular`].
    fn rebuild(&mut self) -> Result<(), InverseError>;

    /// Measures by how much K C f misses f for random loads f on all rows, each in units of √|K_ii|,
    /// and rebuilds the inverse if a row misses by more than [`DRIFT_LIMIT`] of its unit, or
    /// [`DRIFT_LIMIT_F32`](crate::DRIFT_LIMIT_F32) where C is kept in f32. Returns the most that a
    /// row misses; what may be rounding of K u, entry by entry, is not counted. An inverse that a
    /// rebuild makes no better is let be. [`Counts`] tell of the rebuild. One that was computed from K since its
    /// last change has not drifted, nor has one that solves with K itself: nothing is measured, and 0 returned.
    ///
    /// Every row of K C − I shows, whatever the stiffness there, for the loads come together as no
    /// row expects them. To be called now and then, best after updates, each time with another
    /// `seed`. Cost: two applications of C as it is kept, and products with the sparse K.
    /// # Errors
    /// As [`rebuild`](Self::rebuild); the drifted inverse is then kept.
    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        let k = self.stiffness();
        let drift = watched_drift(k, seed, |loads| self.solve_many(loads));
        let drift = drift.unwrap_or(f64::INFINITY);
        if is_too_far(self.name(), drift, DRIFT_LIMIT) {
            self.rebuild()?;
        }
        Ok(drift)
    }

    /// The safeguards that took effect so far.
    fn counts(&self) -> Counts {
        Counts::default()
    }
}

/// Safeguards that took effect since the maintainer was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Times that the maintainer rebuilt its inverse from K by itself, for whichever reason.
    pub rebuilds: usize,
    /// Those of them that the drift monitor asked for.
    pub drift_rebuilds: usize,
    /// Updates whose small factor failed: a pivot lost, or of the wrong sign.
    pub failed_pivots: usize,
    /// Corrections of a solution by its residual, one per right-hand side and step.
    pub refinement_steps: usize,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, more: Self) {
        self.rebuilds += more.rebuilds;
        self.drift_rebuilds += more.drift_rebuilds;
        self.failed_pivots += more.failed_pivots;
        self.refinement_steps += more.refinement_steps;
    }
}

impl Update {
    /// Makes this update alone.
    /// # Errors
    /// As the method of [`InverseMaintainer`].
    pub fn make<M: InverseMaintainer + ?Sized>(
        &self,
        maintainer: &mut M,
    ) -> Result<(), InverseError> {
        match self {
            Self::Split(change) => maintainer.split(change).map(drop),
            Self::Merge { slot, change } => maintainer.merge(*slot, change).map(drop),
            Self::Content(change) => maintainer.change(change),
        }
    }

    /// Makes one after the other.
    pub(crate) fn make_all<M: InverseMaintainer + ?Sized>(
        updates: &[Self],
        maintainer: &mut M,
    ) -> Result<(), InverseError> {
        updates.iter().enumerate().try_for_each(|(done, update)| {
            update.make(maintainer).map_err(|source| InverseError::in_batch(done, source))
        })
    }
}

/// The largest s_j = √|K_jj| ‖D^(−½)(K c_j − e_j)‖ over random columns j, D = |diag K|.
///
/// Dimensionless: independent of units and of the ratio of moduli. Of the columns as
/// [`columns`](InverseMaintainer::columns) delivers them: refined ones where a maintainer refines.
/// Infinite if anything on the way is not finite; 0 without vertices or samples. `seed` picks the
/// columns. Cost: O(samples) columns and products with the sparse K.
#[must_use]
pub fn drift(maintainer: &dyn InverseMaintainer, seed: u64, samples: usize) -> f64 {
    let k = maintainer.stiffness();
    let block = k.block();
    let columns = |rows: &[usize]| {
        let slots: Vec<usize> = rows.iter().map(|row| row / block).collect();
        let all = maintainer.columns(&slots)?;
        let own = |at: usize| block * at + rows[at] % block;
        Ok(Mat::from_fn(all.nrows(), rows.len(), |i, at| all[(i, own(at))]))
    };
    drift_of_columns(k, seed, samples, columns).unwrap_or(f64::INFINITY)
}

/// A load, and what it is replied with, applied one after the other.
pub(crate) fn reply_by_two(
    apply: impl Fn(&[f64], &mut [f64]) -> Result<(), InverseError>,
    f: &[f64],
    rows: &[usize],
    reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
    u: &mut [f64],
) -> Result<(), InverseError> {
    apply(f, u)?;
    let there: Vec<f64> = rows.iter().map(|&row| u[row]).collect();
    let (mut load, mut more) = (vec![0.0; f.len()], vec![0.0; f.len()]);
    rows.iter().zip(reply(&there)).for_each(|(&row, force)| load[row] += force);
    apply(&load, &mut more)?;
    u.iter_mut().zip(more).for_each(|(u, more)| *u += more);
    Ok(())
}

/// G C Gᵀ from the columns of the slots that the loads act on.
pub(crate) fn compliance_by_columns<M: InverseMaintainer + ?Sized>(
    maintainer: &M,
    loads: &[Load],
) -> Result<Mat<f64>, InverseError> {
    let (k, block) = (maintainer.stiffness(), maintainer.stiffness().block());
    let rows = || loads.iter().flatten().map(|load| load.0);
    check_range(&rows().collect::<Vec<_>>(), k.dofs())?;
    let mut slots: Vec<usize> = rows().map(|row| row / block).collect();
    slots.sort_unstable();
    slots.dedup();
    let columns = maintainer.columns(&slots)?;
    let column = |row: usize| block * slots.partition_point(|&s| s < row / block) + row % block;
    let entry = |i: usize, j: usize| -> f64 {
        let pairs = loads[i].iter().flat_map(|a| loads[j].iter().map(move |b| (a, b)));
        pairs.map(|(&(row, a), &(other, b))| a * b * columns[(row, column(other))]).sum()
    };
    Ok(Mat::from_fn(loads.len(), loads.len(), |i, j| 0.5 * (entry(i, j) + entry(j, i))))
}
