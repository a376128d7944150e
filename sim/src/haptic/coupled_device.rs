//! A device and the tool that it leads, tick by tick.

use nalgebra::Vector3;

use super::coupling::{ForceModel, VirtualCoupling};
use super::options::HapticOptions;
use super::passivity::Passivity;

/// A device and its tool between two ticks, for a loop of one's own; [`run`](super::run) has one in its.
#[derive(Clone, Copy, Debug)]
pub struct CoupledDevice {
    coupling: VirtualCoupling,
    period_s: f64,
    device: Vector3<f64>,
    tool: Vector3<f64>,
    passivity: Passivity,
}

impl CoupledDevice {
    /// A device at `start`, m, and its tool there too.
    pub fn new(options: &HapticOptions, start: Vector3<f64>) -> Self {
        let HapticOptions { coupling, period_s, passivity, .. } = *options;
        let passivity = Passivity::new(passivity);
        Self { coupling, period_s, device: start, tool: start, passivity }
    }

    /// A period later, with the device at `device`, m, and a body that answers as `met` says: where
    /// the tool is, m, and the force that the hand exerts, N, the opposite of what it feels.
    pub fn tick(&mut self, device: Vector3<f64>, met: &ForceModel) -> (Vector3<f64>, Vector3<f64>) {
        let Self { coupling, period_s, .. } = *self;
        let (tool, force) = coupling.tool(&device, &self.device, &self.tool, period_s, met);
        let force = self.passivity.tick(&(device - self.device), &force);
        (self.device, self.tool) = (device, tool);
        (tool, force)
    }

    /// The energy that the hand has put in.
    pub fn passivity(&self) -> &Passivity {
        &self.passivity
    }
}
