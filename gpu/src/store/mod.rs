//! A dense C stored on a device.
//!
//! `device_store.rs` is the file to open first: [`DeviceStore`](device_store::DeviceStore).
//! `reads.rs` is what is read of C, `edits.rs` what changes it, `recording.rs` the commands of one
//! submit, `upload.rs` the transfer of a whole C.

mod device_store;
mod edits;
mod reads;
mod recording;
mod upload;

pub use device_store::DeviceStore;
