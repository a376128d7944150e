//! Device adapters for the inverse resident on a GPU.
//!
//! Vulkan through wgpu. For now the crate says which adapters this machine has and what they can
//! hold; nothing is opened or allocated on them.
//!
//! ```no_run
//! for (index, adapter) in yawara_gpu::adapters()?.iter().enumerate() {
//!     println!("{index}: {adapter}");
//! }
//! # Ok::<(), yawara_gpu::GpuError>(())
//! ```
#![forbid(unsafe_code)]

mod adapters;
mod error;
mod report;

pub use adapters::adapters;
pub use error::GpuError;
pub use report::{AdapterReport, DeviceType};
