//! The matrix K itself: [`SparseStiffness`] in `stiffness.rs`, the file to open first, and the
//! checks on every matrix, vector and slot that is passed in (`checks.rs`). `fresh_rows.rs` puts rows
//! summed anew in the place of what updates have left of them.

mod checks;
mod fresh_rows;
mod stiffness;

pub use checks::SYMMETRY_LIMIT;
pub(crate) use checks::{
    check_length, check_matrix, check_range, check_slots, check_symmetry, check_vector,
    scaled_difference,
};
pub use fresh_rows::FreshRows;
pub(crate) use stiffness::RowsBefore;
pub use stiffness::SparseStiffness;
