//! The inverse of a symmetric stiffness matrix, resident on a GPU.
//!
//! Vulkan through wgpu. C lies on the device, in f64 or f32; updates, products and columns are
//! computed there, and only small blocks and single columns come back to the host, which does the
//! small algebra in f64. [`build`] makes it by name for a [`Device`] that is open; it is then used
//! as any other [`InverseMaintainer`](yawara_inverse_update::InverseMaintainer).
//!
//! ```no_run
//! for (index, adapter) in yawara_gpu::adapters()?.iter().enumerate() {
//!     println!("{index}: {adapter}");
//! }
//! # Ok::<(), yawara_gpu::GpuError>(())
//! ```
#![forbid(unsafe_code)]

mod adapters;
mod bandwidth;
mod choice;
mod device;
mod error;
mod inverse;
mod kernels;
mod layout;
mod report;
mod room;
mod scalar;
mod store;
mod upload;

pub use adapters::adapters;
pub use choice::AdapterChoice;
pub use device::{Device, DeviceOptions};
pub use error::GpuError;
pub use inverse::{CHOICES, DeviceInverse, build, on_device};
pub use layout::needed_bytes;
pub use report::{AdapterReport, DeviceType};
pub use scalar::DeviceScalar;
pub use store::DeviceStore;
