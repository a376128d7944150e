//! Haptic devices: forces at the device's rate while the solver makes steps at its own.
//!
//! [`run`] in `session` is where to start; `device_loop` keeps time with the device in a thread of
//! its own, [`VirtualCoupling`] lies between the device and the tool, `summary` says how it went.

mod coupling;
mod device_loop;
mod options;
mod session;
mod summary;

pub use coupling::{ForceModel, VirtualCoupling};
pub use options::{Device, HapticOptions};
pub use session::run;
pub use summary::{HapticSummary, StepRate};
