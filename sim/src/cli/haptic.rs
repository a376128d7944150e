//! `yawara haptic`: a simulated hand that follows a scene's path in real time.

use yawara::haptic::{self, HapticOptions, HapticSummary};
use yawara::{SimError, Simulation, VirtualCoupling, scene_file};

use super::arguments::HapticArguments;
use super::printer::Printer;

/// How many points of the scene's path the hand is made of, a second of the scene's time.
const POINTS_PER_SECOND: f64 = 1000.0;

/// The most of them.
const MOST_POINTS: usize = 10_000_000;

/// Runs the scene in a hand and prints how that went; writes it as JSON where asked.
pub fn run(arguments: &HapticArguments, out: &mut Printer) -> Result<(), SimError> {
    let (scene, _) = scene_file::load(&arguments.scene, &arguments.set)?;
    let mut simulation = Simulation::builder(&scene).build()?;
    let options = HapticOptions {
        tool: arguments.tool,
        seconds: arguments.seconds,
        coupling: VirtualCoupling {
            stiffness_n_m: arguments.stiffness_n_m,
            damping_n_s_m: arguments.damping_n_s_m,
        },
        passivity: !arguments.no_passivity,
        ..HapticOptions::default()
    };
    let length = scene.time.steps as f64 * scene.time.step_s;
    let count = ((length * POINTS_PER_SECOND) as usize).clamp(1, MOST_POINTS);
    let points: Vec<[f64; 3]> = (0..=count)
        .map(|i| Ok(simulation.tool_pose(options.tool, length * i as f64 / count as f64)?.move_m))
        .collect::<Result<_, SimError>>()?;
    // Again and again: a hand that pokes.
    let device = |t: f64| points[(t / length * count as f64) as usize % points.len()];
    let summary = haptic::run(&mut simulation, &device, &options)?;
    out.print(&text(&summary))?;
    arguments.out.as_deref().map_or(Ok(()), |path| summary.write_json(path))
}

fn text(summary: &HapticSummary) -> String {
    let HapticSummary { period_ms: period, age_ms: age, steps_per_second: rate, .. } = summary;
    format!(
        "loop      {} ticks in {:.2} s, {:.2} % late; period {:.3} ms (99 %: {:.3}, most {:.3}); {}\n\
         block     {:.2} ms old (99 %: {:.2}, most {:.2}); extrapolation off by {:.4} N (99 %: {:.4})\n\
         steps     {} of {} converged, {:.0} a second (99 %: {:.0}), at most {} vertices\n\
         force     at most {:.4} N on the device\n\
         energy    never below {:.2e} J of the hand; the device braked in {} ticks\n\
         coupling  stable for a device of more than {:.3} N s/m of its own damping: {}\n",
        summary.ticks,
        summary.seconds,
        summary.late_percent,
        period.p50,
        period.p99,
        period.max,
        if summary.is_realtime { "goes before all else" } else { "takes its turn" },
        age.p50,
        age.p99,
        age.max,
        summary.extrapolation_error_n.p50,
        summary.extrapolation_error_n.p99,
        summary.converged,
        summary.steps,
        rate.p50,
        rate.p99,
        summary.vertices_max,
        summary.force_max_n,
        summary.passivity.least_energy_j,
        summary.passivity.controlled_ticks,
        summary.damping_limit_n_s_m,
        if summary.is_passive { "yes" } else { "NO" },
    )
}
