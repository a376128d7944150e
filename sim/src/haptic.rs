//! A hand on a tool: forces at the rate of a device while the solver goes at its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use crate::coupling::{ForceModel, VirtualCoupling};
use crate::error::SimError;
use crate::report::Percentiles;
use crate::simulation::Simulation;
use crate::tools::Pose;

/// Where the hand is: displacement of the device from its start in scanner axes, m, at a time, s.
pub type Device<'a> = &'a (dyn Fn(f64) -> [f64; 3] + Sync);

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
    /// Damping that the device has of its own, N s/m, for the limit in the summary.
    pub device_damping_n_s_m: f64,
}

impl Default for HapticOptions {
    /// 1 kHz for 5 s on the first tool, 500 N/m and 0.1 N s/m, a device of 0.5 N s/m.
    fn default() -> Self {
        Self {
            tool: 0,
            seconds: 5.0,
            period_s: 1e-3,
            coupling: VirtualCoupling { stiffness_n_m: 500.0, damping_n_s_m: 0.1 },
            device_damping_n_s_m: 0.5,
        }
    }
}

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

/// What the solver tells the device's loop.
#[derive(Clone, Copy)]
struct Snapshot {
    model: ForceModel,
    /// When the tool was asked to go there.
    asked: Instant,
}

/// What the two loops share; each side holds the lock for a copy alone.
struct Shared {
    snapshot: Mutex<Snapshot>,
    /// Where the tool is to go next, m, and when that was said.
    target: Mutex<(Vector3<f64>, Instant)>,
    ended: AtomicBool,
}

/// What the device's loop has seen.
#[derive(Default)]
struct Ticks {
    starts: Vec<Duration>,
    lateness_ms: Vec<f64>,
    age_ms: Vec<f64>,
    late: usize,
    missed: usize,
    force_max: f64,
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `simulation` with `device` in a hand on one of its tools: a thread of its own couples device
/// and tool every `period_s` and extrapolates the tool's force with the last 3 × 3 stiffness, while the
/// calling thread makes steps as fast as they go, each with the tool where the coupling has it.
///
/// Wall-clock time decides what it computes: two runs are not alike. The scene's clock goes on by its
/// `step_s` a step; paths of other tools and pressures follow that.
/// # Errors
/// [`SimError::NoSuchTool`]; [`SimError::Haptic`] for options out of range; those of
/// [`Simulation::step`].
pub fn run(
    simulation: &mut Simulation,
    device: Device<'_>,
    options: &HapticOptions,
) -> Result<HapticSummary, SimError> {
    check(options)?;
    let tool = options.tool;
    simulation.tool_pose(tool, 0.0)?;
    let start = Vector3::from(device(0.0));
    let model = ForceModel {
        position: start,
        force: Vector3::zeros(),
        stiffness: Matrix3::zeros(),
        is_unilateral: true,
    };
    let begin = Instant::now();
    let shared = Shared {
        snapshot: Mutex::new(Snapshot { model, asked: begin }),
        target: Mutex::new((start, begin)),
        ended: AtomicBool::new(false),
    };
    let mut made = Made::default();
    let (ticks, outcome) = thread::scope(|scope| {
        let ticking = scope.spawn(|| tick(&shared, device, options, begin));
        let outcome = solve(simulation, &shared, options, begin, &mut made);
        shared.ended.store(true, Ordering::Relaxed);
        (ticking.join().unwrap_or_default(), outcome)
    });
    outcome?;
    Ok(summary(simulation.name(), options, &ticks, &made, begin.elapsed()))
}

fn check(options: &HapticOptions) -> Result<(), SimError> {
    let HapticOptions { seconds, period_s, coupling, device_damping_n_s_m, .. } = *options;
    let within = |value: f64, low: f64, high: f64| value >= low && value <= high;
    for (key, value, low, high) in [
        ("seconds", seconds, 1e-3, 86_400.0),
        ("period_s", period_s, 1e-4, 1.0),
        ("stiffness_n_m", coupling.stiffness_n_m, 1e-6, 1e9),
        ("damping_n_s_m", coupling.damping_n_s_m, 0.0, 1e9),
        ("device_damping_n_s_m", device_damping_n_s_m, 0.0, 1e9),
    ] {
        if !within(value, low, high) {
            return Err(SimError::Haptic { key, value, low, high });
        }
    }
    Ok(())
}

/// What the solver's loop has made.
#[derive(Default)]
struct Made {
    step_ms: Vec<f64>,
    converged: usize,
    vertices: usize,
    errors_n: Vec<f64>,
}

/// Steps until the time is over.
fn solve(
    simulation: &mut Simulation,
    shared: &Shared,
    options: &HapticOptions,
    begin: Instant,
    made: &mut Made,
) -> Result<(), SimError> {
    let tool = options.tool;
    while begin.elapsed().as_secs_f64() < options.seconds {
        let step = Instant::now();
        let (target, asked) = *lock(&shared.target);
        simulation.set_tool_pose(tool, Pose { move_m: target.into(), turn_deg: 0.0 })?;
        let report = simulation.step()?;
        let felt = &report.tools[tool];
        let rows = simulation.tool_stiffness(tool)?;
        let model = ForceModel {
            position: target,
            force: Vector3::from(felt.force_n),
            stiffness: Matrix3::from_fn(|i, j| rows[i][j]),
            is_unilateral: felt.kind == "probe",
        };
        // What did not converge is no force to feel.
        if report.converged {
            let mut snapshot = lock(&shared.snapshot);
            let old = snapshot.model;
            let guess = old.force + old.stiffness * (target - old.position);
            made.errors_n.push((guess - model.force).norm());
            *snapshot = Snapshot { model, asked };
            made.converged += 1;
        }
        made.vertices = made.vertices.max(report.vertices);
        made.step_ms.push(step.elapsed().as_secs_f64() * 1e3);
    }
    Ok(())
}

/// Shorter waits are spun away: a sleep may take that much longer.
const SPIN: Duration = Duration::from_micros(150);

/// The device's loop.
fn tick(shared: &Shared, device: Device<'_>, options: &HapticOptions, begin: Instant) -> Ticks {
    let period = Duration::from_secs_f64(options.period_s);
    let most = (options.seconds / options.period_s) as usize + 1;
    let mut ticks = Ticks::default();
    for series in [&mut ticks.lateness_ms, &mut ticks.age_ms] {
        series.reserve(most.min(1 << 24));
    }
    let mut before = Vector3::from(device(0.0));
    let mut at = before;
    let mut due = begin + period;
    while !shared.ended.load(Ordering::Relaxed) {
        wait(due);
        let now = Instant::now();
        let late = now.saturating_duration_since(due);
        ticks.starts.push(now - begin);
        ticks.lateness_ms.push(late.as_secs_f64() * 1e3);
        ticks.late += usize::from(2 * late > period);
        let snapshot = *lock(&shared.snapshot);
        ticks.age_ms.push((now - snapshot.asked).as_secs_f64() * 1e3);
        let hand = Vector3::from(device((now - begin).as_secs_f64()));
        let (x, force) =
            options.coupling.tool(&hand, &before, &at, options.period_s, &snapshot.model);
        (before, at) = (hand, x);
        ticks.force_max = ticks.force_max.max(force.norm());
        *lock(&shared.target) = (x, now);
        due += period;
        while due + period < Instant::now() {
            due += period;
            ticks.missed += 1;
        }
    }
    ticks
}

/// Sleeps, then spins, until `due`.
fn wait(due: Instant) {
    let left = due.saturating_duration_since(Instant::now());
    if left > SPIN {
        thread::sleep(left - SPIN);
    }
    while Instant::now() < due {
        std::hint::spin_loop();
    }
}

fn summary(
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
        late_percent: 100.0 * late as f64 / all.max(1) as f64,
        period_ms: Percentiles::of(&periods),
        lateness_ms: Percentiles::of(&ticks.lateness_ms),
        age_ms: Percentiles::of(&ticks.age_ms),
        steps: made.step_ms.len(),
        steps_per_second: StepRate { p50: rate(step.p50), p99: rate(step.p99) },
        converged: made.converged,
        vertices_max: made.vertices,
        force_max_n: ticks.force_max,
        extrapolation_error_n: Percentiles::of(&made.errors_n),
        damping_limit_n_s_m: options.coupling.damping_limit(options.period_s),
        is_passive: options.coupling.is_passive(options.device_damping_n_s_m, options.period_s),
    }
}
