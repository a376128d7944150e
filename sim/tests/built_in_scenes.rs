//! Hard scenes end converged, with what it took counted.

use yawara::report::Summary;
use yawara::{Simulation, Stages, scene_file};

fn run(name: &str, set: &[&str]) -> (Summary, f64) {
    let set: Vec<String> = set.iter().map(|key| (*key).into()).collect();
    let (scene, _) = scene_file::load(name, &set).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{name}: {report:?}");
        assert!(report.residual <= scene.solver.residual);
    }
    let frame = simulation.frame().unwrap();
    let largest = frame.displacement_mm.iter().flatten().fold(0.0, |m: f64, u| {
        assert!(u.is_finite());
        m.max(u.abs())
    });
    let summary = simulation.summary().unwrap();
    let steps = &summary.steps;
    assert_eq!(steps.converged, steps.count);
    println!("{name}: {:?}, {} halvings", steps.converged_by, steps.halvings);
    assert!(steps.converged_by.values().sum::<usize>() >= steps.count);
    // The monitor's bound: beyond it the inverse has started afresh.
    let inverse = &summary.inverse;
    let watched = inverse.drift_max <= 1e-8 || inverse.drift_rebuilds > 0;
    assert!(watched, "{name}: {:e}", inverse.drift_max);
    (summary, largest)
}

#[test]
fn drop_swings() {
    let (summary, _) = run("drop", &[]);
    let motion = summary.motion.unwrap();
    assert!(motion.kinetic_j > 0.0 && summary.mesh.splits > 0);
    // Let go level, it hangs below its fixed end on the mean.
    assert!(motion.centre_m[2] < 0.0, "{motion:?}");
}

#[test]
fn stiff_comes_back() {
    let (summary, largest_mm) = run("stiff", &[]);
    assert!(summary.mesh.splits > 0 && summary.force.max_n > 0.0);
    assert!(largest_mm < 1e-2, "{largest_mm} mm");
}

/// A split shows a stiff inclusion in soft material that is stretched ten times its length: from there no
/// equilibrium is found but by softened bodies first.
#[test]
fn stiff_with_pressures_comes_back() {
    let (summary, largest_mm) = run("stiff", &["stages.element=p1p1"]);
    assert!(summary.mesh.splits > 0 && summary.steps.converged_by.contains_key("newton"));
    assert!(largest_mm < 1e-2, "{largest_mm} mm");
}

#[test]
fn no_attempt_begins_after_the_iterations_of_a_step() {
    let set = ["solver.step_iterations=2".to_string(), "solver.residual=1e-14".into()];
    let (scene, _) = scene_file::load("extreme", &set).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    for _ in 0..3 {
        let report = simulation.step().unwrap();
        // One attempt of three methods with two iterations each; no halves.
        assert!(!report.converged && report.substeps == 0, "{report:?}");
        assert!(report.fallbacks <= 2 && report.iterations <= 3 * 2, "{report:?}");
    }
    assert_eq!(simulation.summary().unwrap().steps.halvings, 0);
}

#[test]
fn near_incompressible_comes_back() {
    let (summary, largest_mm) = run("near_incompressible", &[]);
    assert!(summary.plan.iter().any(|row| row.stage == "element" && row.choice == "p1p1"));
    assert!(summary.mesh.splits > 0);
    assert!(largest_mm < 1e-2, "{largest_mm} mm");
}

#[test]
fn extreme_comes_back() {
    let (summary, largest_mm) = run("extreme", &[]);
    assert!(summary.force.max_n > 0.0);
    assert!(largest_mm < 1e-2, "{largest_mm} mm");
}

/// Linear elasticity loses five of these steps: elements collapse where σ₂ + σ₃ = 0.
#[test]
fn neo_hookean_takes_a_pull_of_three_lengths() {
    let set = [
        "stages.law=neo_hookean",
        "materials.0.poisson_ratio=0.45",
        "mesh.start_level=3",
        "mesh.max_level=3",
        "time.steps=12",
        "tools.0.path=[{time_s=0},{time_s=1,move_m=[0.24,0,0]}]",
    ];
    for element in ["stages.element=p1", "stages.element=p1p1"] {
        let (summary, largest_mm) = run("extreme", &[&set[..], &[element]].concat());
        assert_eq!(summary.steps.converged, 12, "{element}");
        assert!(largest_mm < 1e-2, "{element}: {largest_mm} mm");
    }
}

fn law(summary: &Summary) -> Option<String> {
    summary.plan.iter().find(|row| row.stage == "law").map(|row| row.choice.clone())
}

/// Under the linear law, which shorter pulls get, six of these steps are lost.
#[test]
fn a_pull_by_more_than_half_of_the_body_gets_the_law_for_it() {
    let pull = "tools.0.path=[{time_s=0},{time_s=0.5,move_m=[-0.04,0.1,0.1]}]";
    let (summary, largest_mm) = run("liver", &[pull, "image.voxel_mm=4"]);
    assert_eq!(law(&summary).as_deref(), Some("neo_hookean"));
    assert_eq!(summary.steps.converged, 24);
    assert!(largest_mm < 1e-2, "{largest_mm} mm");
    let half = "tools.0.path=[{time_s=0},{time_s=0.5,move_m=[-0.02,0.06,0.06]}]";
    let (summary, _) = run("liver", &[half, "image.voxel_mm=4", "time.steps=1"]);
    assert_eq!(law(&summary).as_deref(), Some("linear"));
}

#[test]
fn a_ball_of_material_that_is_turned_far_gets_it_too() {
    let set = ["image.voxel_mm=4", "tools.0.turn_axis=[0,0,1]", "time.steps=1"];
    for (turn_deg, want) in [(14, "linear"), (20, "neo_hookean")] {
        let path = format!("tools.0.path=[{{time_s=0}},{{time_s=0.5,turn_deg=-{turn_deg}}}]");
        let (summary, _) = run("liver", &[&set[..], &[&path]].concat());
        assert_eq!(law(&summary).as_deref(), Some(want), "{turn_deg} degrees");
    }
}

/// Under the linear law a bar that is turned inside out collapses where σ₂ + σ₃ = 0, and no way leads on.
#[test]
fn where_no_way_leads_on_an_equilibrium_is_looked_for_from_rest() {
    let set = [
        "stages.law=linear",
        "stages.element=p1p1",
        "materials.0.poisson_ratio=0.49",
        "mesh.start_level=3",
        "mesh.max_level=3",
    ];
    let overrides = set.map(str::to_owned);
    let (scene, _) = scene_file::load("extreme", &overrides).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let converged: Vec<bool> = (0..14).map(|_| simulation.step().unwrap().converged).collect();
    let summary = simulation.summary().unwrap();
    let lost = converged.iter().position(|converged| !converged).unwrap();
    let found = converged[lost..].iter().any(|converged| *converged);
    assert!(found && summary.steps.from_rest >= 1, "{converged:?}, {:?}", summary.steps);
    assert!(converged.iter().filter(|converged| **converged).count() >= 9, "{converged:?}");
}

#[test]
fn a_body_at_rest_is_not_refined_by_what_rounding_leaves() {
    let set = ["tools=[]", "image.voxel_mm=4", "time.steps=3"];
    for element in ["stages.element=p1", "stages.element=p1p1"] {
        let (summary, _) = run("liver", &[&set[..], &[element]].concat());
        assert_eq!((summary.mesh.splits, summary.mesh.merges), (0, 0), "{element}");
    }
}

#[test]
fn homogeneous_leaves_out_what_it_does_not_need() {
    let (summary, largest_mm) = run("homogeneous", &[]);
    let left_out: Vec<&str> =
        summary.plan.iter().filter(|row| !row.runs).map(|row| &row.stage[..]).collect();
    for stage in ["homogenisation", "dynamics", "refinement", "inverse update", "surface"] {
        assert!(left_out.contains(&stage), "{stage} runs: {left_out:?}");
    }
    assert!(left_out.contains(&"compliance columns"));
    assert_eq!((summary.inverse.updates, summary.mesh.splits), (0, 0));
    assert!(largest_mm > 1.0);
}
