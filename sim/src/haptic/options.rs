//! How a haptic loop runs.

use super::coupling::VirtualCoupling;
use crate::error::SimError;

/// How a haptic loop runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HapticOptions {
    /// Number of the tool in the hand.
    pub tool: usize,
    /// For how long, s.
    pub seconds: f64,
    /// Period of the device's loop, s.
    pub period_s: f64,
    /// Between device and tool.
    pub coupling: VirtualCoupling,
    /// Whether the device brakes where it would give the hand energy that the hand has not put in
    /// ([`Passivity`](super::Passivity)); else that is only observed.
    pub passivity: bool,
    /// Damping that the device has of its own, N s/m, for the limit in the summary.
    pub device_damping_n_s_m: f64,
}

impl Default for HapticOptions {
    /// 1 kHz for 5 s on the first tool, 500 N/m and 0.1 N s/m, kept passive, a device of 0.5 N s/m.
    fn default() -> Self {
        Self {
            tool: 0,
            seconds: 5.0,
            period_s: 1e-3,
            coupling: VirtualCoupling { stiffness_n_m: 500.0, damping_n_s_m: 0.1 },
            passivity: true,
            device_damping_n_s_m: 0.5,
        }
    }
}

impl HapticOptions {
    /// Refuses options out of range.
    pub(super) fn check(&self) -> Result<(), SimError> {
        let Self { seconds, period_s, coupling, device_damping_n_s_m, .. } = *self;
        for (key, value, low, high) in [
            ("seconds", seconds, 1e-3, 86_400.0),
            ("period_s", period_s, 1e-4, 1.0),
            ("stiffness_n_m", coupling.stiffness_n_m, 1e-6, 1e9),
            ("damping_n_s_m", coupling.damping_n_s_m, 0.0, 1e9),
            ("device_damping_n_s_m", device_damping_n_s_m, 0.0, 1e9),
        ] {
            if !(low..=high).contains(&value) {
                let want = format!("{low} to {high}");
                return Err(SimError::value("haptic loop", key, value, want));
            }
        }
        Ok(())
    }
}
