//! A dense C stored on a device.
//!
//! `device_store.rs` is the file to open first: [`DeviceStore`](device_store::DeviceStore).
//! `dense_store.rs` is what the maintainer asks of it, `recording.rs` the commands of one submit,
//! `upload.rs` the transfer of a whole C; `bandwidth.rs` measures the memory that C is in.

mod bandwidth;
mod dense_store;
mod device_store;
mod recording;
mod upload;

pub use device_store::DeviceStore;
