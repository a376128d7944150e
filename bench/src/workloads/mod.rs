//! What is done to a body: random splits, merges and changes of material, the same on every run.
//!
//! Start with `history.rs`.

pub(crate) mod history;
pub(crate) mod material_edits;
pub(crate) mod random;

pub(crate) use history::{History, Update};
pub(crate) use material_edits::MaterialEdits;
pub(crate) use random::SplitMix64;
