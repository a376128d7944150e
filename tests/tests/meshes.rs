//! A scene whose supports and tools hold material is one problem on every mesh: on nested uniform
//! meshes it only gets softer, and both elements go to the same.

use nalgebra::Vector3;
use yawara::{Simulation, Stages, scene_file};

/// Levels 0, 3 and 6 have half the edges of the one before.
const FINEST: usize = 6;

/// The force of the tools at the end, N.
fn force(scene: &str, element: &str, level: usize, set: &[&str]) -> f64 {
    let mut all = vec![
        format!("mesh.start_level={level}"),
        format!("mesh.max_level={level}"),
        "mesh.max_vertices=10000".into(),
        format!("stages.element={element}"),
        "time={ steps = 4, step_s = 0.25 }".into(),
    ];
    all.extend(set.iter().map(|set| String::from(*set)));
    let (scene, _) = scene_file::load(scene, &all).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let mut force = Vector3::zeros();
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{element}, level {level}: {report:?}");
        force = report.force_n.into();
    }
    force.norm()
}

/// Checks that forces fall from level to level, and that their limits by Richardson's rule are
/// within 3 %.
fn fall_to_one_limit(scene: &str, set: &[&str]) {
    let limits = ["p1", "p1p1"].map(|element| {
        let forces: Vec<f64> =
            (0..=FINEST).map(|level| force(scene, element, level, set)).collect();
        assert!(forces.is_sorted_by(|a, b| a > b), "{element}: {forces:?} N");
        let [first, second] = [forces[0] - forces[3], forces[3] - forces[6]];
        assert!(second < 0.7 * first, "{element}: {forces:?} N");
        let limit = forces[6] - second * second / (first - second);
        println!("{element}: {forces:?}, limit {limit} N");
        limit
    });
    assert!((limits[0] / limits[1] - 1.0).abs() < 0.03, "{limits:?} N");
}

/// The end of the beam is held in a ball, whose boundary no face of any mesh follows.
#[test]
fn a_support_askew_to_the_mesh() {
    let support = "fixed=[{ shape = 'sphere', centre = [0.05, 0.4, 0.45], radius_m = 0.03 }]";
    fall_to_one_limit("beam", &[support, "gravity_m_s2=[0.0, 0.0, 0.0]"]);
}

#[test]
fn a_probe_pressed_into_a_block() {
    let path = "tools.0.path=[{ time_s = 0, move_m = [0, 0, 0.02] }, \
                { time_s = 1, move_m = [0, 0, 0.016] }]";
    let size = "image.size_mm=[80.0, 80.0, 40.0]";
    fall_to_one_limit("indent", &[size, "tools.0.radius_m=0.02", path]);
}
