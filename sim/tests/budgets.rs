//! Budgets of refinement: what is wanted waits, is counted, and changes no digit of a step.

use yawara::report::StepReport;
use yawara::{Simulation, Stages, scene_file};

fn run(set: &[&str]) -> (Vec<StepReport>, Simulation) {
    let common = ["time.steps=10", "tools.0.release_s=9.0"];
    let overrides: Vec<String> = common.iter().chain(set).map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load("beam", &overrides).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let mut reports = Vec::new();
    while simulation.steps_left() > 0 {
        reports.push(simulation.step().unwrap());
    }
    (reports, simulation)
}

#[test]
fn splits_wait_until_the_budget_allows_and_steps_stay_solved() {
    let (free, _) = run(&[]);
    let (bound, simulation) = run(&["refinement.max_splits_per_step=7"]);
    assert!(free.iter().all(|r| r.splits + r.waiting <= 200 || r.splits == 200));
    assert!(free.iter().any(|r| r.splits > 7));
    for report in &bound {
        assert!(report.converged && report.residual <= 1e-6, "{report:?}");
        assert!(report.splits <= 7);
        // Nothing waits while there is room.
        assert!(report.splits == 7 || report.waiting == 0, "{report:?}");
    }
    assert!(bound.iter().any(|r| r.waiting > 0));
    let summary = simulation.summary().unwrap();
    assert_eq!(summary.mesh.waiting_max, bound.iter().map(|r| r.waiting).max().unwrap());
    assert_eq!(summary.mesh.waiting_end, bound.last().unwrap().waiting);
}

#[test]
fn what_waits_comes_in_later_largest_first() {
    // The end stays where it is after half a second: what is wanted then, all of it comes in.
    let hold = "tools.0.path=[{ time_s = 0.0 }, { time_s = 0.5, move_m = [0.0, 0.0, 0.02] }]";
    let set = [hold, "time.steps=60", "refinement.merge_fraction=0.0"];
    let (slow, _) = run(&[&set[..], &["refinement.max_splits_per_step=9"]].concat());
    let end = slow.last().unwrap();
    assert_eq!((end.splits, end.waiting), (0, 0), "{end:?}");
    let (fast, _) = run(&set);
    let (few, many) = (end.vertices as f64, fast.last().unwrap().vertices as f64);
    assert!((few / many - 1.0).abs() < 0.2, "{few} and {many} vertices");
}

#[test]
fn the_clock_decides_in_real_time_alone() {
    let (free, _) = run(&[]);
    let vertices = |reports: &[StepReport]| reports.iter().map(|r| r.vertices).collect::<Vec<_>>();
    // A millisecond that no step keeps, but nothing is to be in real time.
    let (ignored, simulation) = run(&["budget.step_ms=1e-6"]);
    assert_eq!(vertices(&free), vertices(&ignored));
    let plan = simulation.plan().iter().find(|row| row.stage == "budget").unwrap();
    assert!(plan.why.contains("do not count"), "{}", plan.why);
    let (none, simulation) = run(&["budget={ step_ms = 1e-6, realtime = true }"]);
    // No equilibrium is looked for, but the body goes along with the tool, which feels it.
    assert!(none.iter().all(|r| r.splits == 0 && !r.converged && r.residual > 1e-6));
    let (last, solved) = (none.last().unwrap(), free.last().unwrap());
    let [force, true_force] = [last, solved].map(|r| r.tools[0].force_n[2]);
    assert!((force / true_force - 1.0).abs() < 0.5, "{force} N, {true_force} N in equilibrium");
    assert_eq!(simulation.summary().unwrap().steps.converged, 0);
    let (all, _) = run(&["budget={ step_ms = 1e9, realtime = true }"]);
    assert_eq!(vertices(&free), vertices(&all));
}

#[test]
fn rotation_asks_where_a_bar_bends_and_not_where_it_stretches() {
    let rules = ["stages.indicator=rotation", "refinement.split_above=5e-5"];
    let bent = run(&rules).0;
    assert!(bent.iter().map(|r| r.splits).sum::<usize>() > 10);
    let pull = "tools.0.path=[{ time_s = 0.0 }, { time_s = 1.0, move_m = [0.02, 0.0, 0.0] }]";
    let still = ["gravity_m_s2=[0.0, 0.0, 0.0]", "materials.0.poisson_ratio=0.0", pull];
    let pulled = run(&[&rules[..], &still].concat()).0;
    assert_eq!(pulled.iter().map(|r| r.splits + r.waiting).sum::<usize>(), 0);
}

/// Steps of a hand measure what the mesh should be now and then, long ones and those of inertia each.
#[test]
fn short_steps_measure_the_mesh_fifty_times_a_second() {
    let estimate = |keys: &[&str]| {
        let set: Vec<String> = keys.iter().map(|key| (*key).into()).collect();
        let (scene, _) = scene_file::load("beam", &set).unwrap();
        let mut simulation =
            Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
        let mut measured = Vec::new();
        for _ in 0..12 {
            measured.push(simulation.step().unwrap().error_estimate.is_some());
        }
        let plan = simulation.summary().unwrap().plan;
        let row = plan.iter().find(|row| row.stage == "error estimate").unwrap();
        (row.why.clone(), measured.iter().filter(|is| **is).count())
    };
    let hand = ["time.step_s=0.00333333333", "output.frames_every=1000"];
    let with = |more: &[&'static str]| [&hand[..], more].concat();
    for (keys, when, count) in [
        (vec![], "in every step", 12),
        (with(&[]), "in one of 6 steps", 2),
        (with(&["dynamics={}"]), "in every step", 12),
        (with(&["refinement.every_steps=2"]), "in one of 2 steps", 6),
    ] {
        let (why, found) = estimate(&keys);
        assert!(why.contains(when), "{keys:?}: {why}");
        assert_eq!(found, count, "{keys:?}");
    }
}
