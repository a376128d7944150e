//! A long run of random tool motion: no NaN, no drift, no growth.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering};
use std::sync::{Mutex, PoisonError};

use yawara::scene::{GrabEntry, Key, ToolEntry};
use yawara::{Simulation, Stages, scene_file};

/// A sequence of numbers in [−1, 1) that looks random (splitmix64).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / (1u64 << 63) as f64 - 1.0
    }
}

/// Farthest that the tool goes from rest, and in a step, m.
const REACH: f64 = 0.02;
const STRIDE: f64 = 0.004;

/// A random walk of the tool that turns back at the end of its reach.
fn walk(steps: usize, step_s: f64, seed: u64) -> Vec<Key> {
    let mut draws = Draws(seed);
    let mut at = [0.0; 3];
    let mut path = vec![Key { time_s: 0.0, move_m: at, turn_deg: 0.0 }];
    for step in 1..=steps {
        for x in &mut at {
            let to = *x + STRIDE * draws.next();
            *x = if to.abs() > REACH { *x - (to - *x) } else { to };
        }
        path.push(Key { time_s: step as f64 * step_s, move_m: at, turn_deg: 0.0 });
    }
    path
}

/// The system's allocator, counted: what a process holds of the system's pages also tells of the
/// allocator's habits. Products of matrices reserve 600 MB in each thread, of which they touch little: what
/// is above `RESERVED` is left out.
struct Counted;

static HELD: AtomicIsize = AtomicIsize::new(0);
const RESERVED: usize = 1 << 28;

fn count(layout: Layout, sign: isize) {
    if layout.size() < RESERVED {
        HELD.fetch_add(sign * layout.size() as isize, Ordering::Relaxed);
    }
}

// SAFETY: both calls are passed on as they are.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout, 1);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        count(layout, -1);
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static HEAP: Counted = Counted;

/// One run at a time: what another one holds would be counted too.
static ALONE: Mutex<()> = Mutex::new(());

/// Runs `steps` steps; prints the figures.
fn endure(steps: usize, dynamic: bool) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut set = vec![
        "image.voxel_mm=4.0".to_string(),
        "mesh={ base_mm = 32.0, start_level = 0, max_level = 3, max_vertices = 260 }".into(),
        "stages.element=p1".into(),
        "stages.indicator=energy".into(),
        "refinement={ split_above = 3e-6, merge_fraction = 0.1 }".into(),
        "tools.0.region.radius_m=0.03".into(),
        format!("time.steps={steps}"),
    ];
    if dynamic {
        set.push("dynamics={ damping_mass_per_s = 2.0 }".into());
        set.push("time.step_s=0.02".into());
    }
    let (mut scene, _) = scene_file::load("liver", &set).unwrap();
    let step_s = scene.time.step_s;
    for tool in &mut scene.tools {
        let ToolEntry::Grab(GrabEntry { path, release_s, .. }) = tool else { panic!("{tool:?}") };
        (*path, *release_s) = (walk(steps, step_s, scene.seed), None);
    }
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let (mut splits, mut merges, mut missed, mut fallbacks, mut substeps) = (0, 0, 0, 0, 0);
    let mut memory = Vec::new();
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.residual.is_finite(), "{report:?}");
        assert!(report.force_n.iter().all(|f| f.is_finite()), "{report:?}");
        (splits, merges) = (splits + report.splits, merges + report.merges);
        (fallbacks, substeps) = (fallbacks + report.fallbacks, substeps + report.substeps);
        missed += usize::from(!report.converged);
        if report.step.is_multiple_of((steps / 10).max(1)) {
            let held = HELD.load(Ordering::Relaxed) as f64;
            memory.push(held);
            let frame = simulation.frame().unwrap();
            assert!(frame.points_mm.iter().flatten().all(|x| x.is_finite()));
            let megabytes = held / 1e6;
            println!("step {}: {megabytes:.2} MB, {} vertices", report.step, report.vertices);
        }
    }
    let summary = simulation.summary().unwrap();
    let inverse = &summary.inverse;
    println!(
        "{steps} steps: {splits} splits, {merges} merges, {missed} not converged, {fallbacks} \
         fallbacks, {substeps} parts, {} updates, {} rebuilds ({} for drift), largest drift {:.1e}, \
         {:.2} ms a step (99 %: {:.2})",
        inverse.updates,
        inverse.rebuilds,
        inverse.drift_rebuilds,
        inverse.drift_max,
        summary.steps.time_ms.p50,
        summary.steps.time_ms.p99
    );
    assert!(splits > steps / 10 && merges > steps / 10, "{splits} splits, {merges} merges");
    assert!(inverse.drift_max <= 1e-8, "{:e}", inverse.drift_max);
    assert_eq!(missed, 0);
    // Times are kept for percentiles: some 30 numbers a step. The first half warms up; a factor that a thread is making
    // just then, or not, is some 2 MB.
    let most = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
    let (first, second) = memory.split_at(memory.len().div_ceil(2));
    let grown = most(second) - most(first);
    let allowed = 4e6 + 200.0 * steps as f64;
    assert!(grown < allowed, "{grown} bytes more after {steps} steps");
}

#[test]
fn random_tool_motion_leaves_no_trace() {
    endure(200, false);
}

#[test]
fn random_tool_motion_with_inertia_leaves_no_trace() {
    endure(200, true);
}

#[test]
#[ignore = "minutes: 100 000 steps, or as many as the variable YAWARA_ENDURANCE_STEPS says"]
fn random_tool_motion_for_long() {
    let steps = std::env::var("YAWARA_ENDURANCE_STEPS").ok();
    endure(steps.map_or(100_000, |steps| steps.parse().unwrap()), false);
}
