//! A hand that knows the body's weak points gets no energy out of it that it has not put in.

use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::{Matrix3, Vector3};
use yawara::haptic::{CoupledDevice, HapticOptions, force_model};
use yawara::indicator::{Indicator, RingMember};
use yawara::{ForceModel, Pose, Simulation, Stages, scene_file};

/// Ticks of the device, and how many of them the solver takes for a step.
const TICKS: u32 = 100_000;
const TICKS_A_STEP: u32 = 20;

/// A sequence of numbers in [0, 1) that looks random (splitmix64).
#[derive(Default)]
struct Draws(AtomicU64);

impl Draws {
    fn next(&self) -> f64 {
        let mut z = self.0.fetch_add(0x9e37_79b9_7f4a_7c15, Ordering::Relaxed);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 2f64.powi(64)
    }
}

/// Splits and merges at random.
impl Indicator for Draws {
    fn name(&self) -> &'static str {
        "draws"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn measure(&self, _: &[RingMember]) -> f64 {
        // A third comes, a third goes, a third stays.
        [10.0, 0.0, 0.5][(3.0 * self.next()) as usize]
    }
}

/// A small soft block under a ball; the mesh changes in every step.
fn simulation() -> Simulation {
    let set = [
        "image.size_mm=[120.0, 120.0, 80.0]",
        "image.voxel_mm=10.0",
        "mesh={ base_mm = 40.0, start_level = 0, max_level = 2, max_vertices = 90 }",
        "stages={ element = 'p1' }",
        "refinement={ split_above = 1.0, merge_fraction = 0.1, dwell_steps = 0, max_splits_per_step = 4 }",
        "tools.0.spacing_m=0.01",
        "solver.residual=1e-3",
    ];
    let (scene, _) = scene_file::load("indent", &set.map(String::from)).unwrap();
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    stages.indicator = Box::new(Draws::default());
    Simulation::builder(&scene).stages(stages).build().unwrap()
}

/// A device and what its hand has put in, summed apart from what the device sums.
struct Hand {
    device: CoupledDevice,
    energy: f64,
    least: f64,
}

impl Hand {
    fn new(start: Vector3<f64>, passivity: bool) -> Self {
        let options = HapticOptions { passivity, ..HapticOptions::default() };
        Self { device: CoupledDevice::new(&options, start), energy: 0.0, least: 0.0 }
    }

    fn tick(&mut self, from: Vector3<f64>, to: Vector3<f64>, met: &ForceModel) -> Vector3<f64> {
        let (tool, force) = self.device.tick(to, met);
        self.energy += force.dot(&(to - from));
        self.least = self.least.min(self.energy);
        tool
    }
}

/// Dives while the last block knows of no contact, comes out while it is pushed, and trembles besides.
fn next_place(at: Vector3<f64>, met: &ForceModel, draws: &Draws) -> Vector3<f64> {
    let is_pushed = met.force.norm() > 1e-3;
    let tremble = Vector3::from_fn(|_, _| 2e-5 * (draws.next() - 0.5));
    let speed = if is_pushed { 1e-4 } else { -3e-4 } * (0.2 + draws.next());
    let mut to = at + tremble + Vector3::new(0.0, 0.0, speed);
    to.z = to.z.clamp(0.03, 0.043);
    to
}

#[test]
fn a_hand_that_dives_unfelt_and_is_pushed_out_gains_nothing() {
    let mut simulation = simulation();
    let start = Vector3::new(0.0, 0.0, 0.042);
    let (stiffness, is_unilateral) = (Matrix3::zeros(), true);
    let mut met = ForceModel { position: start, force: Vector3::zeros(), stiffness, is_unilateral };
    let (mut kept, mut free) = (Hand::new(start, true), Hand::new(start, false));
    let (mut at, draws) = (start, Draws::default());
    let (mut splits, mut merges, mut converged) = (0, 0, 0);
    for tick in 1..=TICKS {
        let to = next_place(at, &met, &draws);
        free.tick(at, to, &met);
        let tool = kept.tick(at, to, &met);
        at = to;
        if tick % TICKS_A_STEP == 0 {
            let pose = Pose { move_m: tool.into(), turn_deg: 0.0 };
            simulation.set_tool_pose(0, pose).unwrap();
            let report = simulation.step().unwrap();
            (splits, merges) = (splits + report.splits, merges + report.merges);
            if report.converged {
                converged += 1;
                met = force_model(&simulation, &report, 0, tool).unwrap();
            }
        }
    }
    let (with, without) = (kept.device.passivity().summary(), free.device.passivity().summary());
    println!(
        "{splits} splits, {merges} merges, {converged} steps converged; with {:e} J {with:?}, \
         without {:e} J {without:?}",
        kept.least, free.least
    );
    assert!(splits > 5000 && merges > 5000 && converged > 4500, "{splits} {merges} {converged}");
    assert!(kept.least >= -1e-9 && with.least_energy_j >= -1e-9);
    assert!(free.least < -1.0 && without.controlled_ticks == 0, "{}", free.least);
    assert!(with.controlled_ticks > 1000);
}
