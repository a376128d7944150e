//! The loop of the solver, beside that of the device.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Instant;

use nalgebra::{Matrix3, Vector3};

use super::coupling::ForceModel;
use super::device::Device;
use super::device_loop::{Shared, Snapshot, lock, tick};
use super::options::HapticOptions;
use super::summary::{HapticSummary, Made, summary};
use crate::error::SimError;
use crate::report::StepReport;
use crate::step::Simulation;
use crate::tools::Pose;

/// Runs `simulation` with `device` in a hand on one of its tools: a thread of its own couples
/// device and tool every `period_s` and extrapolates the tool's force with the last 3 × 3
/// stiffness, while the calling thread makes steps as fast as they go, each with the tool where the
/// coupling has it.
///
/// Results depend on wall-clock time: two runs differ. The scene's clock goes on by
/// its `step_s` a step; paths of other tools and pressures follow that.
/// # Errors
/// [`SimError::NoSuchTool`]; [`SimError::Value`] for options out of range; those of
/// [`Simulation::step`].
pub fn run(
    simulation: &mut Simulation,
    device: &mut dyn Device,
    options: &HapticOptions,
) -> Result<HapticSummary, SimError> {
    options.check()?;
    let tool = options.tool;
    simulation.tool_pose(tool, 0.0)?;
    let start = Vector3::from(device.position(0.0));
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
        let model = force_model(simulation, &report, tool, target)?;
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

/// How a tool that stands at `position` (displacement in scanner axes, m) pushes the body near there, as
/// the step of `report`, the last one, has it.
/// # Errors
/// As [`Simulation::tool_stiffness`].
pub fn force_model(
    simulation: &Simulation,
    report: &StepReport,
    tool: usize,
    position: Vector3<f64>,
) -> Result<ForceModel, SimError> {
    let rows = simulation.tool_stiffness(tool)?;
    let felt = &report.tools[tool];
    Ok(ForceModel {
        position,
        force: Vector3::from(felt.force_n),
        stiffness: Matrix3::from_fn(|i, j| rows[i][j]),
        is_unilateral: felt.is_unilateral,
    })
}
