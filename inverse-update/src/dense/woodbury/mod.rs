//! `woodbury`, `woodbury_f32`: [`PackedInverse`](inverse::PackedInverse) in `inverse.rs` holds C
//! and applies updates; `prepare.rs` computes what an update adds to C.

mod inverse;
mod prepare;

pub use inverse::{PackedInverse, Woodbury, WoodburyF32};
