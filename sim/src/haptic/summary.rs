//! The summary of a haptic loop, also as JSON.

use std::path::Path;
use std::time::Duration;

use serde::Serialize;

use super::device_loop::Ticks;
use super::options::HapticOptions;
use super::passivity::PassivitySummary;
use super::udp_device::UdpSummary;
use crate::error::SimError;
use crate::output::write_json;
use crate::report::Percentiles;

/// How a haptic loop went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HapticSummary {
    /// Version of this layout.
    pub schema: u32,
    /// The scene's name.
    pub scene: String,
    /// How long it ran, s.
    pub seconds: f64,
    /// Ticks of the device's loop.
    pub ticks: usize,
    /// Whether the system runs the device's loop before everything else.
    pub is_realtime: bool,
    /// Ticks that began more than half a period after they were due, or not at all, %.
    pub late_percent: f64,
    /// From tick to tick, ms.
    pub period_ms: Percentiles,
    /// How long after it was due a tick began, ms.
    pub lateness_ms: Percentiles,
    /// Age of the force and stiffness that a tick extrapolated from, ms: since the device was where
    /// they are of.
    pub age_ms: Percentiles,
    /// Steps of the solver.
    pub steps: usize,
    /// Steps per second that half of the steps reach, and that 99 % reach.
    pub steps_per_second: StepRate,
    /// Steps that converged.
    pub converged: usize,
    /// Most vertices.
    pub vertices_max: usize,
    /// Largest force on the device, N.
    pub force_max_n: f64,
    /// The energy that the hand had put in.
    pub passivity: PassivitySummary,
    /// What came in and went out, of a device that is reached by UDP.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub udp: Option<UdpSummary>,
    /// How far an extrapolated force was from the solver's next one, N.
    pub extrapolation_error_n: Percentiles,
    /// K T/2 + |B| of the coupling, N s/m.
    pub damping_limit_n_s_m: f64,
    /// Whether the device's own damping is above it.
    pub is_passive: bool,
}

/// Steps per second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StepRate {
    /// Median.
    pub p50: f64,
    /// What 99 % of the steps reach.
    pub p99: f64,
}

impl HapticSummary {
    /// Writes it as JSON, replacing what stands at `path` only once the file is whole.
    /// # Errors
    /// [`SimError::Io`].
    pub fn write_json(&self, path: &Path) -> Result<(), SimError> {
        write_json(path, self)
    }
}

/// What the solver's loop has made.
#[derive(Default)]
pub(super) struct Made {
    pub step_ms: Vec<f64>,
    pub converged: usize,
    pub vertices: usize,
    pub errors_n: Vec<f64>,
}

pub(super) fn summary(
    scene: &str,
    options: &HapticOptions,
    ticks: &Ticks,
    made: &Made,
    elapsed: Duration,
) -> HapticSummary {
    let all = ticks.starts.len() + ticks.missed;
    let late = ticks.late + ticks.missed;
    let periods: Vec<f64> =
        ticks.starts.windows(2).map(|pair| (pair[1] - pair[0]).as_secs_f64() * 1e3).collect();
    let step = Percentiles::of(&made.step_ms);
    let rate = |ms: f64| if ms > 0.0 { 1e3 / ms } else { 0.0 };
    HapticSummary {
        schema: 1,
        scene: scene.into(),
        seconds: elapsed.as_secs_f64(),
        ticks: ticks.starts.len(),
        is_realtime: ticks.is_realtime,
        late_percent: 100.0 * late as f64 / all.max(1) as f64,
        period_ms: Percentiles::of(&periods),
        lateness_ms: Percentiles::of(&ticks.lateness_ms),
        age_ms: Percentiles::of(&ticks.age_ms),
        steps: made.step_ms.len(),
        steps_per_second: StepRate { p50: rate(step.p50), p99: rate(step.p99) },
        converged: made.converged,
        vertices_max: made.vertices,
        force_max_n: ticks.force_max,
        passivity: ticks.passivity,
        udp: None,
        extrapolation_error_n: Percentiles::of(&made.errors_n),
        damping_limit_n_s_m: options.coupling.damping_limit(options.period_s),
        is_passive: options.coupling.is_passive(options.device_damping_n_s_m, options.period_s),
    }
}
