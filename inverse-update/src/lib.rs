//! The inverse of a symmetric stiffness matrix, positive definite or quasi-definite, kept up to
//! date while vertices come and go.
//!
//! This crate knows matrices and index sets, no meshes. A *vertex* is a block of
//! [`SparseStiffness::block`] rows (3 displacements, or 4 with a pressure), a *slot* its number,
//! `0..vertices()`. A split appends one slot; a merge removes one and moves the last slot into the
//! gap (as `Vec::swap_remove`), so that storage stays dense.
#![forbid(unsafe_code)]

mod batch;
mod capacitance;
mod change;
mod counts;
mod delayed;
mod dense_store;
mod drift;
mod error;
mod fresh;
mod full;
mod host_store;
mod lu;
mod net_change;
mod panel;
mod paper;
mod refine;
mod residual;
mod soften;
mod sparse;
mod stiffness;
mod stiffness_edit;
mod stored;
mod tiles;
mod update;
mod woodbury;

pub use batch::Update;
pub use change::{CONSISTENCY_LIMIT, RingChange, SYMMETRY_LIMIT, StiffnessChange};
pub use counts::Counts;
pub use delayed::{Delayed, MOST_DELAYED};
pub use dense_store::{DenseStore, Staged};
pub use drift::{DRIFT_LIMIT, DRIFT_LIMIT_F32, drift};
pub use error::{InverseError, StorageError};
pub use host_store::HostStore;
pub use lu::Lu;
pub use paper::Paper;
pub use refine::{MOST_REFINEMENTS, REFINED_RESIDUAL};
pub use residual::REFINEMENT_LIMIT;
pub use sparse::{RebaseOptions, Sparse, elimination_order};
pub use stiffness::SparseStiffness;
pub use stored::Stored;
pub use woodbury::{PackedInverse, Woodbury, WoodburyF32};

use change::check_matrix;
use faer::{Mat, MatRef};

/// The scene names that [`build`] knows, the default first.
pub const CHOICES: &[&str] = &["woodbury", "woodbury_f32", "delayed", "sparse", "paper", "lu"];

/// Free vertices from which `sparse` beats a dense inverse at everything but reading columns.
const SPARSE_FROM: usize = 150;

/// Free vertices up to which a dense inverse wins where each update is followed by reading columns
/// of at least [`MANY_COLUMNS`] vertices in full.
const DENSE_TO: usize = 450;

/// See [`DENSE_TO`].
const MANY_COLUMNS: usize = 3;

/// The maintainer that takes least time for a split with a solve, by measurement (the crossings
/// in the study `table1`), given how many free vertices there are and of how many of them full
/// columns are read after each update.
pub fn choose(vertices: usize, columns_per_update: usize) -> &'static str {
    let reads_many = columns_per_update >= MANY_COLUMNS && vertices <= DENSE_TO;
    if vertices < SPARSE_FROM || reads_many { "woodbury" } else { "sparse" }
}

/// Makes the maintainer of that name and inverts `stiffness`. Cost: O(n³), O(n²) for `sparse`.
///
/// # Errors
/// [`InverseError::Unknown`] if `name` is not one of [`CHOICES`]; [`InverseError::Singular`] if
/// `stiffness` is not positive definite (a part of the body hangs free), or not quasi-definite as
/// it announces; [`InverseError::BlockTooLarge`].
pub fn build(
    name: &str,
    stiffness: SparseStiffness,
) -> Result<Box<dyn InverseMaintainer>, InverseError> {
    match name {
        "woodbury" => Ok(Box::new(Woodbury::new(stiffness)?)),
        "woodbury_f32" => Ok(Box::new(WoodburyF32::new(stiffness)?)),
        "delayed" => Ok(Box::new(Delayed::new(stiffness, HostStore::new())?)),
        "sparse" => Ok(Box::new(Sparse::new(stiffness)?)),
        "paper" => Ok(Box::new(Paper::new(stiffness)?)),
        "lu" => Ok(Box::new(Lu::new(stiffness)?)),
        _ => Err(InverseError::Unknown { name: name.to_owned(), choices: CHOICES }),
    }
}

/// Keeps what it takes to apply C = K⁻¹ while K changes by rings of tetrahedra.
///
/// One implementation per file; [`build`] makes them by name. All matrices are in N/m (K) and
/// m/N (C); rows are vertex-major x, y, z. After an error the object holds what it held before.
pub trait InverseMaintainer: Send {
    /// The scene name of the method, e.g. `woodbury`.
    fn name(&self) -> &'static str;

    /// Where the inverse lies, if not in the host's memory: which device and what it takes there.
    fn place(&self) -> Option<String> {
        None
    }

    /// Vertices (blocks) now held.
    fn vertices(&self) -> usize;

    /// The matrix whose inverse is kept, for residuals.
    fn stiffness(&self) -> &SparseStiffness;

    /// A vertex comes in: K becomes [K + K_c − K_p, a12; a21, A22]. Returns its slot, the last.
    ///
    /// # Errors
    /// [`InverseError`] if `change` has wrong shapes, is not finite or makes K singular.
    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError>;

    /// The vertex at `slot` goes out, the reverse of [`split`](Self::split) with the same
    /// `change` (`change.slots` as they are before the removal, without `slot`). Returns the
    /// slot that was moved into `slot`, if any.
    ///
    /// # Errors
    /// As [`split`](Self::split).
    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError>;

    /// The vertex at `slot` is fixed from now on: its rows and columns leave K. Returns the slot
    /// that was moved into `slot`, if any. The last vertex may be fixed too: nothing is left then.
    ///
    /// [`RingChange::freed`] gives a [`split`](Self::split) that frees it again. Cost: as a
    /// [`merge`](Self::merge), with the vertex's neighbours as the ring.
    ///
    /// # Errors
    /// [`InverseError::Slot`] if `slot` is not in `0..vertices()`.
    fn fix(&mut self, slot: usize) -> Result<Option<usize>, InverseError> {
        let change = RingChange::fixed(self.stiffness(), slot)?;
        self.merge(slot, &change)
    }

    /// K changes on existing vertices only (a new vertex that is fixed, a material edit, a cut).
    ///
    /// # Errors
    /// As [`split`](Self::split).
    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError>;

    /// u = C f; both of length `block · vertices()`.
    ///
    /// Where ‖D^(−½)(K u − f)‖ exceeds [`REFINEMENT_LIMIT`] of ‖D^(−½) f‖, D = |diag K|, and the
    /// rounding of K u, a step of refinement is made, which [`Counts`] tell; up to
    /// [`MOST_REFINEMENTS`] where C is kept in f32.
    /// Cost: a product with the sparse K on top of the method's own.
    ///
    /// # Errors
    /// [`InverseError::Shape`]; [`InverseError::NotFinite`], also if u would not be.
    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError>;

    /// U = C F for several loads, one per column of the `block · vertices()` rows of F.
    ///
    /// As [`solve`](Self::solve) for each; a maintainer may read what it keeps once for several.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        check_loads(self.stiffness(), loads)?;
        let mut solutions = Mat::zeros(loads.nrows(), loads.ncols());
        for (j, load) in loads.col_iter().enumerate() {
            let load: Vec<f64> = load.iter().copied().collect();
            self.solve(&load, solutions.col_as_slice_mut(j))?;
        }
        Ok(solutions)
    }

    /// The columns of C that belong to `slots`: (block · vertices()) × (block · slots.len()).
    ///
    /// # Errors
    /// [`InverseError::Slot`] if a slot is not in `0..vertices()`.
    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError>;

    /// The block C_pp of C on the rows and columns of `slots`: what a tool that holds them feels.
    ///
    /// Symmetric, (block · slots.len())². Cost: as [`columns`](Self::columns) unless a method has
    /// a shorter way.
    ///
    /// # Errors
    /// [`InverseError::Slot`] if a slot is not in `0..vertices()`.
    fn compliance(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        let columns = self.columns(slots)?;
        let block = self.stiffness().block();
        let row = |i: usize| block * slots[i / block] + i % block;
        let half = |i: usize, j: usize| 0.5 * columns[(row(i), j)];
        Ok(Mat::from_fn(columns.ncols(), columns.ncols(), |i, j| half(i, j) + half(j, i)))
    }

    /// Several updates one after the other, with slots as those before leave them.
    ///
    /// As single calls would make them; a maintainer may put off work and do it for many at once,
    /// or, where that is less work, compute the inverse afresh of the last K, in which case a
    /// matrix on the way may be singular.
    ///
    /// # Errors
    /// [`InverseError::Batch`] tells which update was refused and why; those before it are made, as
    /// by single calls, those from it on are not.
    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        batch::one_by_one(self, updates)
    }

    /// Whether columns of C lie ready to be read. If not, C_:p w costs less as one solve with the
    /// right-hand side w than from the columns.
    fn holds_columns(&self) -> bool {
        false
    }

    /// Computes the inverse afresh from [`stiffness`](Self::stiffness).
    ///
    /// # Errors
    /// [`InverseError::Singular`].
    fn rebuild(&mut self) -> Result<(), InverseError>;

    /// Measures the drift s_j = √|K_jj| ‖D^(−½)(K c_j − e_j)‖, D = |diag K|, of 8 random columns as
    /// they are kept, and computes the inverse afresh if it is above [`DRIFT_LIMIT`], or
    /// [`DRIFT_LIMIT_F32`] where C is kept in f32. Returns the largest s_j found; [`Counts`] tell
    /// of the fresh start.
    ///
    /// To be called now and then, best after updates. `seed` picks the columns: another one each
    /// time sees all of them sooner or later. Cost: 8 columns and products with the sparse K.
    ///
    /// # Errors
    /// As [`rebuild`](Self::rebuild); the drifted inverse is then kept.
    fn watch(&mut self, seed: u64) -> Result<f64, InverseError>;

    /// The safeguards that took effect so far.
    fn counts(&self) -> Counts;
}

/// As many rows as the matrix has, all of them finite.
fn check_loads(k: &SparseStiffness, loads: MatRef<'_, f64>) -> Result<(), InverseError> {
    check_matrix("loads", loads, (k.dofs(), loads.ncols()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dense_where_it_is_small_or_its_columns_are_read() {
        assert_eq!(choose(20, 0), "woodbury");
        assert_eq!(choose(400, 0), "sparse");
        assert_eq!(choose(400, 9), "woodbury");
        assert_eq!(choose(600, 9), "sparse");
        assert_eq!(choose(2000, 9), "sparse");
        assert!([0, 200, 4000].iter().all(|&n| CHOICES.contains(&choose(n, 1))));
    }
}
