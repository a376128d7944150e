//! A hand on a tool: forces at the rate of a device while the solver goes at its own.

mod device_loop;
mod summary;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Instant;

use nalgebra::{Matrix3, Vector3};

use crate::coupling::{ForceModel, VirtualCoupling};
use crate::error::SimError;
use crate::simulation::Simulation;
use crate::tools::Pose;
use device_loop::tick;
use summary::summary;
pub use summary::{HapticSummary, StepRate};

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

/// Runs `simulation` with `device` in a hand on one of its tools: a thread of its own couples
/// device and tool every `period_s` and extrapolates the tool's force with the last 3 × 3
/// stiffness, while the calling thread makes steps as fast as they go, each with the tool where the
/// coupling has it.
///
/// Wall-clock time decides what it computes: two runs are not alike. The scene's clock goes on by
/// its `step_s` a step; paths of other tools and pressures follow that.
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

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
