//! A change of the mesh is felt little by little: no tool feels it at once, nothing else than the body holds what is
//! still missing, and in the end the body is where it would be without.

use yawara::report::StepReport;
use yawara::{Simulation, Stages, scene_file};

fn simulation(scene: &str, set: &[&str]) -> Simulation {
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load(scene, &overrides).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

fn size(force: [f64; 3]) -> f64 {
    force.iter().map(|f| f * f).sum::<f64>().sqrt()
}

/// By how much the force leaves its trend at most in a step after a change of the mesh, in parts of the largest.
fn off_trend(reports: &[StepReport]) -> f64 {
    let force: Vec<f64> = reports.iter().map(|r| size(r.force_n)).collect();
    let largest = force.iter().fold(0.0f64, |a, &b| a.max(b));
    let changed = |i: &usize| reports[i - 1].splits + reports[i - 1].merges > 0;
    let second = |i: usize| (force[i] - 2.0 * force[i - 1] + force[i - 2]).abs();
    (2..force.len()).filter(changed).map(second).fold(0.0, f64::max) / largest
}

#[test]
fn a_ball_does_not_feel_the_mesh_change_under_it() {
    let run = |ease: &str| {
        // Then the ball turns, which is felt at once.
        let mut simulation = simulation("palpate", &["time.steps=41", ease]);
        let reports: Vec<_> = (0..41).map(|_| simulation.step().unwrap()).collect();
        assert!(reports.iter().all(|r| r.converged));
        assert!(reports.iter().map(|r| r.splits).sum::<usize>() > 20);
        off_trend(&reports)
    };
    let (at_once, eased) = (run("refinement.ease_s=0"), run("refinement.ease_s=0.03"));
    assert!(at_once > 0.04 && eased < 0.4 * at_once, "{at_once} at once, {eased} little by little");
}

const SMALL: [&str; 6] = [
    "image.voxel_mm=4",
    "time.steps=24",
    "time.step_s=0.005",
    "tools.0.release_s=9",
    "refinement.target=0.05",
    "refinement.max_splits_per_step=8",
];

/// However it is held, what tools and supports do to the body adds up to nothing all the while.
#[test]
fn a_hand_that_pulls_does_not_feel_it_either() {
    let path = "tools.0.path=[{ time_s = 0.0 }, { time_s = 0.2, move_m = [-0.004, 0.01, 0.01] }]";
    for hold in ["vertices", "mean", "pad"] {
        let hold = format!("tools.0.hold='{hold}'");
        let run = |ease: &str| {
            let mut simulation = simulation("liver", &[&SMALL[..], &[path, &hold, ease]].concat());
            let mut reports = Vec::new();
            for _ in 0..24 {
                let report = simulation.step().unwrap();
                let support = simulation.support_force();
                let sum = [0, 1, 2].map(|axis| support[axis] + report.force_n[axis]);
                let off = size(sum) / size(report.force_n);
                assert!(off < 1e-5, "{hold} {ease}: step {}, {off}", report.step);
                assert!(report.converged);
                reports.push(report);
            }
            off_trend(&reports)
        };
        let (at_once, eased) = (run("refinement.ease_s=0"), run("refinement.ease_s=0.05"));
        // A vertex that comes into what is held by vertices goes where the tool wants it, at once.
        let is_of_material = !hold.contains("vertices");
        let is_less = eased < 0.4 * at_once;
        assert!(!is_of_material || is_less, "{hold}: {at_once} at once, {eased} little by little");
    }
}

/// What held a vertex that goes out holds the ends of its edge.
#[test]
fn it_adds_up_where_held_vertices_go_out() {
    let set = [
        "gravity_m_s2=[0,0,0]",
        "time.steps=40",
        "time.step_s=0.005",
        "support.hold=vertices",
        "refinement.split_above=1e-6",
        "refinement.max_splits_per_step=40",
        "refinement.merge_fraction=0.9",
        "tools.0.release_s=9",
        "tools.0.path=[{time_s=0},{time_s=0.08,move_m=[0,0,0.02]},{time_s=0.2,move_m=[0,0,0.004]}]",
    ];
    let mut simulation = simulation("beam", &set);
    let (mut merges, mut most) = (0, 0.0_f64);
    for _ in 0..40 {
        let report = simulation.step().unwrap();
        let support = simulation.support_force();
        let sum = [0, 1, 2].map(|axis| support[axis] + report.force_n[axis]);
        most = most.max(size(report.force_n));
        assert!(size(sum) < 1e-5 * most, "step {}: {sum:?} N of {most} N", report.step);
        merges += report.merges;
    }
    assert!(merges > 100, "{merges}");
}

#[test]
fn in_the_end_nothing_is_left_of_it() {
    let path = "tools.0.path=[{ time_s = 0.0 }, { time_s = 0.05, move_m = [-0.004, 0.01, 0.01] }]";
    let coarse = ["mesh.base_mm=30", "refinement.target=0.3", "refinement.every_steps=1", path];
    let run = |ease: &str| {
        let mut simulation = simulation("liver", &[&SMALL[..], &coarse, &[ease]].concat());
        let reports: Vec<_> = (0..24).map(|_| simulation.step().unwrap()).collect();
        assert!(reports[7].splits > 0 && reports[8..].iter().all(|r| r.splits + r.merges == 0));
        reports.iter().map(|r| size(r.force_n)).collect::<Vec<_>>()
    };
    let (at_once, eased) = (run("refinement.ease_s=0"), run("refinement.ease_s=0.05"));
    let off = |step: usize| (eased[step] / at_once[step] - 1.0).abs();
    assert!(off(9) > 5e-4, "felt two steps after the last split: {}", off(9));
    assert!(off(18) < 1e-6 && off(23) < 1e-6, "{} {}", off(18), off(23));
}
