//! `yawara haptic`: a hand on a tool in real time, that of another program or a simulated one.

use crate::haptic::{self, HapticOptions, HapticSummary, PROTOCOL_VERSION, UdpDevice, UdpSummary};
use crate::scene::Scene;
use crate::{SimError, Simulation, VirtualCoupling, scene_file};

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
    let summary = match arguments.udp {
        Some(address) => {
            let start = simulation.tool_pose(arguments.tool, 0.0)?.move_m;
            let mut device = UdpDevice::listen(address, start, arguments.most_force_n)?;
            let here = device.address()?;
            out.print(&format!("listening on {here} (UDP, protocol {PROTOCOL_VERSION})\n"))?;
            let summary = haptic::run(&mut simulation, &mut device, &options)?;
            HapticSummary { udp: Some(device.summary()), ..summary }
        }
        None => {
            let mut device = hand(&scene, &mut simulation, arguments.tool)?;
            haptic::run(&mut simulation, &mut device, &options)?
        }
    };
    out.print(&text(&summary))?;
    arguments.out.as_deref().map_or(Ok(()), |path| summary.write_json(path))
}

/// A hand that follows the path of a tool, again and again.
fn hand(
    scene: &Scene,
    simulation: &mut Simulation,
    tool: usize,
) -> Result<impl FnMut(f64) -> [f64; 3] + Send + use<>, SimError> {
    let length = scene.time.steps as f64 * scene.time.step_s;
    let count = ((length * POINTS_PER_SECOND) as usize).clamp(1, MOST_POINTS);
    let points: Vec<[f64; 3]> = (0..=count)
        .map(|i| Ok(simulation.tool_pose(tool, length * i as f64 / count as f64)?.move_m))
        .collect::<Result<_, SimError>>()?;
    Ok(move |t: f64| points[(t / length * count as f64) as usize % points.len()])
}

fn text(summary: &HapticSummary) -> String {
    let HapticSummary { period_ms: period, age_ms: age, steps_per_second: rate, .. } = summary;
    let mut text = format!(
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
    );
    if let Some(UdpSummary { hands, poses, old, leaps, of_others, refused, forces, cut }) =
        summary.udp
    {
        text += &format!(
            "device    {poses} poses of {hands} program(s) ({old} late, {leaps} leaps), {forces} forces sent, \
             {cut} of them cut; {of_others} packets of others and {refused} of no meaning\n"
        );
    }
    text
}
