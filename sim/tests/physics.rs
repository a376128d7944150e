//! What a user would notice at once: letting go works, held faces do not freeze the body between
//! them, forces scale with stiffness.

use yawara::report::{Frame, StepReport};
use yawara::{Simulation, Stages, scene_file};

/// Runs the beam with these settings.
fn beam(set: &[&str]) -> (Vec<StepReport>, Frame) {
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load("beam", &overrides).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let mut reports = Vec::new();
    while simulation.steps_left() > 0 {
        reports.push(simulation.step().unwrap());
    }
    (reports, simulation.frame().unwrap())
}

fn largest_displacement_mm(frame: &Frame) -> f64 {
    frame.displacement_mm.iter().flatten().fold(0.0, |m: f64, u| m.max(u.abs()))
}

#[test]
fn a_body_pulled_by_more_than_its_length_comes_back() {
    let (reports, frame) =
        beam(&["tools.0.path.1.move_m=[0.0, 0.0, 0.2]", "gravity_m_s2=[0.0, 0.0, 0.0]"]);
    assert!(reports.iter().all(|r| r.converged));
    assert!(reports.iter().any(|r| r.force_n[2] > 1.0));
    assert!(largest_displacement_mm(&frame) < 1e-6);
}

/// Followed back from the pulled shape, which need not be stable without the tool, this took most of a run's time.
#[test]
fn a_body_that_nothing_acts_on_any_more_is_at_rest_at_once() {
    for element in ["p1", "p1p1"] {
        let element = format!("stages.element={element}");
        let set =
            ["gravity_m_s2=[0.0, 0.0, 0.0]", "tools.0.path.1.move_m=[0.0, 0.0, 0.1]", &element];
        let (reports, frame) = beam(&set);
        let after = reports.iter().position(|r| r.time_s > 1.05).unwrap();
        assert!(reports[after - 1].iterations > 0 && reports[after - 1].force_n[2] > 1.0);
        assert!(reports[after..].iter().all(|r| r.converged && r.iterations == 0));
        assert_eq!(largest_displacement_mm(&frame), 0.0);
    }
    // Under its weight it is not.
    let (reports, frame) = beam(&[]);
    assert!(reports.iter().any(|r| r.time_s > 1.05 && r.iterations > 0));
    assert!(largest_displacement_mm(&frame) > 1.0);
}

/// A hand that goes on as before is followed: steps then begin next to where they end, whatever the element.
#[test]
fn a_steady_hand_takes_a_body_along_in_few_iterations() {
    for (element, turned) in [("p1", false), ("p1p1", false), ("p1", true)] {
        let path = match turned {
            false => "[{ time_s = 0.0 }, { time_s = 1.0, move_m = [0.0, 0.0, 0.03] }]",
            true => "[{ time_s = 0.0 }, { time_s = 1.0, turn_deg = 60.0 }]",
        };
        let set = [
            "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
            "mesh.max_level=0".into(),
            "time={ steps = 40, step_s = 0.01 }".into(),
            "stages.equilibrium=anderson".into(),
            format!("stages.element={element}"),
            format!("tools.0.path={path}"),
        ];
        let (scene, _) = scene_file::load("beam", &set).unwrap();
        let stages = || Stages::by_name(&scene.stages).unwrap();
        let mut simulation = Simulation::new(&scene, stages()).unwrap();
        let reports: Vec<_> = (0..40).map(|_| simulation.step().unwrap()).collect();
        let count = |of: &[StepReport]| of.iter().map(|r| r.iterations).sum::<usize>();
        let (first, later) =
            (count(&reports[..3]) as f64 / 3.0, count(&reports[4..]) as f64 / 36.0);
        println!("{element} {turned}: {first:.1} iterations at first, {later:.1} later");
        assert!(reports.iter().all(|r| r.converged));
        assert!(later < 0.7 * first, "{element}: {later} iterations, {first} at first");
    }
}

#[test]
fn a_bar_turned_by_half_a_turn_springs_back() {
    let set = vec!["tools.0.release_s=2.0".to_string()];
    let (scene, _) = scene_file::load("twist", &set).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    while simulation.steps_left() > 0 {
        assert!(simulation.step().unwrap().converged);
    }
    assert!(largest_displacement_mm(&simulation.frame().unwrap()) < 1e-6);
}

#[test]
fn a_turn_that_is_too_much_at_once_is_made_in_parts() {
    let turn = |adaptive: bool| {
        let mut set = vec![format!("time.adaptive={adaptive}")];
        let one = ["time.steps=1", "time.step_s=1.0", "mesh.max_level=0"];
        set.extend(one.map(String::from));
        set.push("stages.equilibrium=anderson".into());
        let (scene, _) = scene_file::load("twist", &set).unwrap();
        let stages = Stages::by_name(&scene.stages).unwrap();
        Simulation::new(&scene, stages).unwrap().step().unwrap()
    };
    let parts = turn(true);
    assert!(parts.converged && parts.substeps > 1 && parts.failure.is_none(), "{parts:?}");
    let whole = turn(false);
    assert!(!whole.converged && whole.substeps == 0);
    let failure = whole.failure.unwrap();
    assert_eq!((failure.step, failure.time_s, failure.reached_s, failure.label), (1, 1.0, 0.0, 1));
    let [adaptive, fallback, ..] = &failure.advice[..] else { panic!("{failure:?}") };
    assert!(adaptive.contains("time.adaptive = true") && fallback.contains("\"fallback\""));
}

#[test]
fn a_body_between_two_fixed_faces_sags() {
    let (reports, frame) = beam(&[
        "tools=[]",
        "time.steps=5",
        "image.size_mm=[160.0, 160.0, 20.0]",
        "materials.0.young_modulus_pa=1000.0",
        "refinement.split_above=1e-9",
        "mesh.max_vertices=6000",
        "fixed=[{ shape = 'box', min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 0.0] }, \
         { shape = 'box', min = [0.0, 0.0, 1.0], max = [1.0, 1.0, 1.0] }]",
        // Weights on vertices: a few layers of them between the faces are not enough.
        "mesh.start_level=6",
    ]);
    assert!(reports.iter().all(|r| r.converged));
    // Away from the free sides, where the column is softer.
    let places = frame.points_mm.iter().zip(&frame.displacement_mm);
    let inner = places.filter(|(x, _)| x[0].abs() < 40.0 && x[1].abs() < 40.0);
    let sag = inner.flat_map(|(_, u)| u).fold(0.0, |m: f64, u| m.max(u.abs()));
    // 1-D column held at both ends: rho g h² / (8 M), M = E (1 − ν)/((1 + ν)(1 − 2ν)) at ν = 0.3.
    let modulus = 1000.0 * 0.7 / (1.3 * 0.4);
    let expected = 1e3 * 1000.0 * 9.81 * 0.02 * 0.02 / (8.0 * modulus);
    assert!((sag / expected - 1.0).abs() < 0.3, "{sag} mm, want about {expected}");
}

#[test]
fn force_goes_with_stiffness_and_not_with_the_unit_of_it() {
    let pull = |young: &str| {
        let young = format!("materials.0.young_modulus_pa={young}");
        let set = ["time.steps=3", "gravity_m_s2=[0.0, 0.0, 0.0]", "mesh.max_level=0", &young];
        beam(&set).0[2].force_n[2]
    };
    let (one, two) = (pull("5e4"), pull("1e5"));
    // Both runs follow the same iterates up to rounding.
    assert!((two / one - 2.0).abs() < 1e-6, "{one} {two}");
}

#[test]
fn pressures_come_and_go_with_the_mesh_and_leave_nothing_behind() {
    for poisson_ratio in [0.3, 0.49] {
        let ratio = format!("materials.0.poisson_ratio={poisson_ratio}");
        let set = [
            "stages.element=p1p1",
            "gravity_m_s2=[0.0, 0.0, 0.0]",
            "time.steps=24",
            "refinement.split_above=1e-7",
            &ratio,
        ];
        let (reports, frame) = beam(&set);
        assert!(reports.iter().all(|r| r.converged && r.residual <= 1e-6));
        let (splits, merges) =
            reports.iter().fold((0, 0), |(s, m), r| (s + r.splits, m + r.merges));
        assert!(splits > 20 && merges > 20, "{poisson_ratio}: {splits} splits, {merges} merges");
        assert!(largest_displacement_mm(&frame) < 1e-6);
    }
}

#[test]
fn a_nearly_incompressible_beam_is_pulled_let_go_and_sags_without_locking() {
    let (reports, _) = beam(&["materials.0.poisson_ratio=0.499"]);
    assert!(reports.iter().all(|r| r.converged));
    let run = |element: &str, ratio: &str| {
        let element = format!("stages.element={element}");
        let ratio = format!("materials.0.poisson_ratio={ratio}");
        let (reports, frame) = beam(&["mesh.max_level=0", &element, &ratio]);
        let converged = reports.iter().all(|r| r.converged);
        (converged, largest_displacement_mm(&frame))
    };
    let (converged, sag) = run("auto", "0.499");
    assert!(converged);
    // Bending stiffness goes with E alone, but for the clamp, on one and the same mesh.
    let (converged, of_compressible) = run("p1p1", "0.3");
    assert!(converged);
    assert!((sag / of_compressible - 1.0).abs() < 0.05, "{sag} mm, {of_compressible} mm");
}

#[test]
fn a_region_that_only_touches_the_body_holds_its_face() {
    let pull = |least: &str| {
        let least = format!("fixed.0.min=[{least}, 0.0, 0.0]");
        beam(&["time.steps=2", "mesh.max_level=0", &least]).0[1].force_n
    };
    assert_eq!(pull("-0.1"), pull("0.0"));
}

/// Whatever comes into a tool's or a fixed region is held as if it had been there from the start.
#[test]
fn a_mesh_refined_everywhere_is_held_as_one_that_starts_so_fine() {
    let held = |mesh: [&str; 3]| {
        let tool = [
            "tools.0.hold=vertices",
            "support.hold=vertices",
            "stages.indicator=energy",
            "tools.0.region={ shape = 'sphere', centre = [1.0, 0.5, 0.5], radius_m = 0.018 }",
            "tools.0.path=[{ time_s = 0.0 }, { time_s = 0.1, move_m = [0.0, 0.0, 0.01] }]",
            "tools.0.release_s=9.0",
            // Ends within the first row of cells.
            "fixed.0.max=[0.07, 1.0, 1.0]",
            "time.steps=12",
        ];
        let (reports, _) = beam(&[&tool[..], &mesh[..]].concat());
        let last = reports[reports.len() - 1].clone();
        assert!(last.converged);
        (last.vertices, last.force_n)
    };
    let (count, force) =
        held(["mesh.start_level=3", "mesh.max_level=3", "refinement.split_above=1e9"]);
    let (refined_count, refined) =
        held(["mesh.start_level=0", "mesh.max_level=3", "refinement.split_above=1e-30"]);
    // What is fixed all round stays coarse.
    assert!((count * 9 / 10..count).contains(&refined_count), "{refined_count} of {count}");
    for i in 0..3 {
        let difference = (refined[i] - force[i]).abs();
        assert!(difference < 1e-4 * force[2].abs(), "{refined:?} instead of {force:?}");
    }
}

#[test]
fn a_tool_that_never_found_an_equilibrium_lets_go_all_the_same() {
    let set = ["stages.corotation=paper", "solver.max_halvings=0", "time.steps=13"];
    let (scene, _) = scene_file::load("beam", &set.map(String::from)).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let mut converged = Vec::new();
    while simulation.steps_left() > 0 {
        converged.push(simulation.step().unwrap().converged);
    }
    assert!(!converged[..10].contains(&true), "{converged:?}");
}
