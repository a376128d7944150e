//! Haptic devices: forces at the device's rate while the solver makes steps at its own.
//!
//! [`run`] in `session` is where to start; `device_loop` keeps time with the device in a thread of
//! its own and has a [`CoupledDevice`]: a [`VirtualCoupling`] lies between the device and the tool, and
//! [`Passivity`] sees to it that no energy comes back that was not put in. A [`Device`] is a function of the
//! time or, by [`UdpDevice`], a program elsewhere, with the packets of `packet`. `summary` says how it went.

mod coupled_device;
mod coupling;
mod device;
mod device_loop;
mod options;
mod packet;
mod passivity;
mod session;
mod summary;
mod udp_device;

pub use coupled_device::CoupledDevice;
pub use coupling::{ForceModel, VirtualCoupling};
pub use device::{Device, Felt};
pub use options::HapticOptions;
pub use packet::{BadPacket, ForcePacket, PROTOCOL_VERSION, PosePacket};
pub use passivity::{Passivity, PassivitySummary};
pub use session::{force_model, run};
pub use summary::{HapticSummary, StepRate};
pub use udp_device::{UdpDevice, UdpSummary};
