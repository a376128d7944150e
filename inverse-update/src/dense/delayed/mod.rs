//! `delayed`, and the algebra of `gpu` and `gpu_f32`: [`Delayed`](inverse::Delayed) in `inverse.rs`
//! makes one update at a time, `batch.rs` several for one read of C; `terms.rs` is the small algebra
//! of both.

mod batch;
mod inverse;
mod terms;

pub use inverse::{Delayed, MOST_DELAYED};
