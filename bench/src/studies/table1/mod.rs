//! `table1`: one vertex in and out at the sizes of the paper's Table 1, by every method.
//!
//! `study.rs` runs it on the processor, `gpu.rs` (feature `gpu`) on a graphics device.

#[cfg(feature = "gpu")]
pub mod gpu;
mod study;

pub use study::run;
