//! `delayed`, and the algebra of `gpu` and `gpu_f32`: [`Delayed`](inverse::Delayed) in `inverse.rs`
//! makes one update at a time, `batch.rs` several for one read of C.

mod batch;
mod inverse;

pub use inverse::{Delayed, MOST_DELAYED};
