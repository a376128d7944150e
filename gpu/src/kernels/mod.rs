//! What runs on the device: one WGSL file per kernel, for both precisions.
//!
//! `pipelines.rs` is the file to open first: the list of kernels, the arguments that they take, and
//! their translation. `layout.rs` says how C lies in memory; `head.wgsl` is the same for the
//! kernels.

mod layout;
mod pipelines;

pub(crate) use layout::{MOST_ROWS, TILE, TILE_AREA, before, tile_rows};
pub use pipelines::Kernels;
pub(crate) use pipelines::{BINDINGS, Kernel, WORK_BYTES, Work};
