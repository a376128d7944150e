//! What can go wrong while an inverse is built or kept.

use std::fmt;
use std::sync::Arc;

use thiserror::Error;

/// Everything that this crate refuses; the object that refused holds what it held before.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum InverseError {
    /// A matrix or vector does not fit the others.
    #[error("{what} is {} × {}, want {} × {}", got.0, got.1, want.0, want.1)]
    Shape {
        /// Which matrix or vector.
        what: &'static str,
        /// Rows and columns it should have.
        want: (usize, usize),
        /// Rows and columns it has.
        got: (usize, usize),
    },
    /// A value is NaN or infinite, or would become so.
    #[error("{what} has {value} in row {row}, column {col}, want a finite number")]
    NotFinite {
        /// Which matrix or vector.
        what: &'static str,
        /// Row of the value.
        row: usize,
        /// Column of the value.
        col: usize,
        /// The value.
        value: f64,
    },
    /// A slot number is too large.
    #[error("slot {slot} does not exist, want a number below {limit}")]
    Slot {
        /// The slot asked for.
        slot: usize,
        /// Number of vertices.
        limit: usize,
    },
    /// A slot is listed twice.
    #[error("slot {0} is listed twice, want every vertex once")]
    DuplicateSlot(usize),
    /// The slot of a vertex to merge is listed as an old vertex of its own ring.
    #[error("slot {0} is to be merged, so its ring can't list it among the old vertices")]
    OwnRing(usize),
    /// A vertex to merge is coupled to a vertex outside its ring: something else still uses it.
    #[error(
        "slot {slot} is coupled to slot {other}, which its ring does not list: undo first what \
         couples them"
    )]
    NotInRing {
        /// The slot to merge.
        slot: usize,
        /// The vertex outside the ring.
        other: usize,
    },
    /// A matrix that has to be symmetric is not.
    #[error(
        "{what} is not symmetric: entries ({row}, {col}) and ({col}, {row}) differ by \
         {difference:e} of its scale, want at most {limit:e}"
    )]
    Asymmetric {
        /// Which matrix.
        what: &'static str,
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        col: usize,
        /// Difference relative to the diagonal.
        difference: f64,
        /// The most that is accepted.
        limit: f64,
    },
    /// The parts of a change contradict each other or the stored matrix.
    #[error("{what} disagree by {error:e} of their scale, want at most {limit:e}")]
    Inconsistent {
        /// What contradicts what.
        what: &'static str,
        /// Relative residual.
        error: f64,
        /// The most that is accepted.
        limit: f64,
    },
    /// A matrix is singular to working precision, or not positive definite.
    #[error(
        "{what} is singular or not positive definite (row {row}: {value:e}, want above \
         {limit:e}): is part of the body not held, or a stiffness zero or negative?"
    )]
    Singular {
        /// Which matrix.
        what: &'static str,
        /// The row at which it showed.
        row: usize,
        /// The pivot or the estimated reciprocal condition that was too small.
        value: f64,
        /// What it has to exceed.
        limit: f64,
    },
    /// One split of several was refused.
    #[error("update {done} of the batch was refused, the {done} before it are made: {source}")]
    Batch {
        /// How many updates were made.
        done: usize,
        /// Why the next one was not.
        source: Box<InverseError>,
    },
    /// Refinement by the matrix itself does not bring a solution closer.
    #[error(
        "{method} can't solve: after {steps} steps of refinement the residual is {residual:e} of \
         the load, want at most {limit:e}: choose an inverse stored in f64"
    )]
    NotRefined {
        /// Scene name of the maintainer.
        method: &'static str,
        /// Steps made.
        steps: usize,
        /// ‖Ku − f‖ / ‖f‖, scaled by the diagonal.
        residual: f64,
        /// What it should come down to.
        limit: f64,
    },
    /// What holds the inverse, a device for one, refused or was lost; K is as it was.
    #[error("{method}: {cause}")]
    Storage {
        /// Scene name of the maintainer.
        method: &'static str,
        /// The storage's own error.
        cause: StorageError,
    },
    /// Blocks of no rows were asked for.
    #[error("a vertex has 0 rows, want at least 1 (3 for displacements)")]
    EmptyBlock,
    /// Blocks have more rows than a maintainer's kernels are made for.
    #[error("a vertex has {block} rows, {method} takes at most {limit}: choose another inverse")]
    BlockTooLarge {
        /// Scene name of the maintainer.
        method: &'static str,
        /// Rows per vertex.
        block: usize,
        /// The most that it takes.
        limit: usize,
    },
    /// No maintainer has this name.
    #[error("inverse {name:?} is not known, want one of {}", choices.join(", "))]
    Unknown {
        /// The name asked for.
        name: String,
        /// The names that exist.
        choices: &'static [&'static str],
    },
}

/// The error of a foreign storage, to be told apart by downcasting [`get`](Self::get).
#[derive(Debug, Clone)]
pub struct StorageError(Arc<dyn std::error::Error + Send + Sync>);

impl StorageError {
    /// Takes the storage's own error.
    pub fn new(cause: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self(Arc::new(cause))
    }

    /// The storage's own error.
    #[must_use]
    pub fn get(&self) -> &(dyn std::error::Error + Send + Sync + 'static) {
        &*self.0
    }
}

/// Prints the storage's own words.
impl fmt::Display for StorageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Equal if they say the same.
impl PartialEq for StorageError {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

impl InverseError {
    /// The error of a batch whose first `done` splits are made.
    pub(crate) fn in_batch(done: usize, source: Self) -> Self {
        Self::Batch { done, source: Box::new(source) }
    }
}
