//! Finding a device and talking to it.
//!
//! `open_device.rs` is the file to open first: an open [`Device`](open_device::Device), its memory
//! budget, and how commands go out and answers come back. `adapters.rs` lists what the machine has,
//! `report.rs` describes each, `choice.rs` picks one.

mod adapters;
mod choice;
mod open_device;
mod report;

pub use adapters::adapters;
pub use choice::AdapterChoice;
pub(crate) use open_device::Memory;
pub use open_device::{Device, DeviceOptions};
pub use report::{AdapterReport, DeviceType};
