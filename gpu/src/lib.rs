//! The inverse of a symmetric stiffness matrix, resident on a GPU.
//!
//! Vulkan through wgpu. C is stored on the device, in f64 or f32; updates, products and columns are
//! computed there; the host reads only small submatrices and single columns, and does the small
//! algebra in f64. [`build`] makes it by name for a [`Device`] that is open; it is then used
//! as any other [`InverseMaintainer`](yawara_inverse_update::InverseMaintainer).
//!
//! ```no_run
//! for (index, adapter) in yawara_gpu::adapters()?.iter().enumerate() {
//!     println!("{index}: {adapter}");
//! }
//! # Ok::<(), yawara_gpu::GpuError>(())
//! ```
#![forbid(unsafe_code)]

mod buffers;
mod device;
mod error;
mod inverse;
mod kernels;
mod scalar;
mod store;

pub use buffers::needed_bytes;
pub use device::{AdapterChoice, AdapterReport, Device, DeviceOptions, DeviceType, adapters};
pub use error::GpuError;
pub use inverse::{CHOICES, DeviceInverse, build, on_device};
pub use scalar::DeviceScalar;
pub use store::DeviceStore;
