//! The loop that keeps time with the device, in a thread of its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

use super::coupled_device::CoupledDevice;
use super::coupling::ForceModel;
use super::device::{Device, Felt};
use super::options::HapticOptions;
use super::passivity::PassivitySummary;

/// What the solver tells the device's loop.
#[derive(Clone, Copy)]
pub(super) struct Snapshot {
    pub model: ForceModel,
    /// When the tool was asked to go there.
    pub asked: Instant,
}

/// What the two loops share; each side holds the lock for a copy alone.
pub(super) struct Shared {
    pub snapshot: Mutex<Snapshot>,
    /// Where the tool is to go next, m, and when that was said.
    pub target: Mutex<(Vector3<f64>, Instant)>,
    pub ended: AtomicBool,
}

/// The lock, whatever happened to the thread that held it before.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What the device's loop has seen.
#[derive(Default)]
pub(super) struct Ticks {
    pub starts: Vec<Duration>,
    pub lateness_ms: Vec<f64>,
    pub age_ms: Vec<f64>,
    pub late: usize,
    pub missed: usize,
    pub force_max: f64,
    pub passivity: PassivitySummary,
    pub is_realtime: bool,
}

/// Of 0 to 99: below the system's own watchdogs.
const URGENCY: u8 = 50;

/// Shorter waits are spun away: a sleep may take that much longer.
const SPIN: Duration = Duration::from_micros(150);

/// The device's loop.
pub(super) fn tick(
    shared: &Shared,
    device: &mut dyn Device,
    options: &HapticOptions,
    begin: Instant,
) -> Ticks {
    let period = Duration::from_secs_f64(options.period_s);
    let most = (options.seconds / options.period_s) as usize + 1;
    let mut ticks = Ticks { is_realtime: run_first(), ..Ticks::default() };
    for series in [&mut ticks.lateness_ms, &mut ticks.age_ms] {
        series.reserve(most.min(1 << 24));
    }
    let mut coupled = CoupledDevice::new(options, Vector3::from(device.position(0.0)));
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
        let hand = Vector3::from(device.position((now - begin).as_secs_f64()));
        let (x, force) = coupled.tick(hand, &snapshot.model);
        ticks.force_max = ticks.force_max.max(force.norm());
        *lock(&shared.target) = (x, now);
        device.feel(&Felt { force_n: -force, tool_m: x });
        due += period;
        while due + period < Instant::now() {
            due += period;
            ticks.missed += 1;
        }
    }
    ticks.passivity = coupled.passivity().summary();
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

/// Has the system run this thread before all that is not as urgent: neither the solver's threads
/// nor another program then makes a tick late. It needs the right to do so; false without.
fn run_first() -> bool {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let Ok(priority) = URGENCY.try_into().map(ThreadPriority::Crossplatform) else { return false };
    set_thread_priority_and_policy(thread_native_id(), priority, policy).is_ok()
}
