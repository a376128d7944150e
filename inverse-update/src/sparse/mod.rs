//! `sparse`: a block LDLᵀ of K, newest vertex eliminated first.
//!
//! `inverse.rs` is the file to open first: [`Sparse`](inverse::Sparse). Making a factor:
//! `pattern.rs` (K as it is read), `dissection.rs` with `vertex_cover.rs` (elimination order), `inherit.rs` (that of
//! before, for a K that updates have changed), `symbolic.rs` (tree and panels), `numeric.rs` with `panel_kernels.rs` (the numbers). Keeping it:
//! `factor.rs` (panels of columns) with `lower.rs` (their L), `pivot.rs` (diagonal blocks), `edit.rs` (what an update does),
//! `bennett.rs` with `sweep.rs` (a low-rank change along a path of the tree), `rebase.rs` (a
//! new elimination order from a thread). Reading it: `packed.rs` (panels in the order
//! of reading, and the kernels), `substitution.rs`, `reply.rs`, `compliance.rs`.

mod bennett;
mod compliance;
mod dissection;
mod edit;
mod factor;
mod inherit;
mod inverse;
mod lower;
mod numeric;
mod packed;
mod panel_kernels;
mod pattern;
mod pivot;
mod rebase;
mod reply;
mod substitution;
mod sweep;
mod symbolic;
mod vertex_cover;

pub(crate) use dissection::order as dissection_order;
pub(crate) use factor::Factor;
pub(crate) use inverse::{FRESH_OPERATION, FRESH_VERTEX, MOST_ROWS};
pub use inverse::{RebaseOptions, Sparse, elimination_order};
pub(crate) use pattern::Pattern;
pub(crate) use pivot::BadPivot;
#[cfg(test)]
pub(crate) use rebase::slow_rebases;
pub(crate) use rebase::{Based, Rebase};
pub(crate) use symbolic::Symbolic;
