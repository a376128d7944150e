//! What a tool that holds material feels: its stiffness against the force of a small move.

use yawara::{Simulation, Stages, scene_file};

/// A small move of the beam's end, m.
const MOVE: f64 = 1e-5;

#[test]
fn the_stiffness_of_a_held_mean_or_pad_is_the_force_of_a_small_move() {
    for hold in ["mean", "pad", "vertices"] {
        for axis in 0..3 {
            let mut to = [0.0; 3];
            to[axis] = MOVE;
            let set = [
                format!("tools.0.hold={hold}"),
                format!("tools.0.path=[{{ time_s = 0 }}, {{ time_s = 0.05, move_m = {to:?} }}]"),
                "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
                "mesh.start_level=2".into(),
                "mesh.max_level=2".into(),
                "time.steps=1".into(),
                "solver.residual=1e-9".into(),
            ];
            let (scene, _) = scene_file::load("beam", &set).unwrap();
            let stages = Stages::by_name(&scene.stages).unwrap();
            let mut simulation = Simulation::new(&scene, stages).unwrap();
            let report = simulation.step().unwrap();
            assert!(report.converged, "{report:?}");
            let stiffness = simulation.tool_stiffness(0).unwrap();
            for row in 0..3 {
                let (want, got) = (report.force_n[row] / MOVE, stiffness[row][axis]);
                // Rotations make the rest, strains of 1e-4.
                assert!(
                    (got - want).abs() < 2e-3 * stiffness[axis][axis],
                    "{hold}, {row} by {axis}: {got} N/m, want {want}"
                );
            }
        }
    }
}
