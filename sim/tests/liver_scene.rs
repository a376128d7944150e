//! The default scene does what the front page says: it refines, merges back, converges in every
//! step, and does so in the same way every time.

use yawara::report::{Frame, StepReport, Summary};
use yawara::{Simulation, Stages, scene_file};

/// A whole run: reports without their times, the frames at full pull and at the end, the summary.
fn run() -> (Vec<String>, [Frame; 2], Summary) {
    let (scene, _) = scene_file::load("liver", &[]).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let mut reports = Vec::new();
    let mut pulled = None;
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        if report.step == 12 {
            pulled = Some(simulation.frame().unwrap());
        }
        reports.push(format!("{:?}", StepReport { times: Default::default(), ..report }));
    }
    (reports, [pulled.unwrap(), simulation.frame().unwrap()], simulation.summary().unwrap())
}

fn bits(frame: &Frame) -> Vec<u64> {
    let vectors = frame.points_mm.iter().chain(&frame.displacement_mm).flatten();
    let scalars = frame.von_mises_pa.iter().chain(&frame.indicator).chain(&frame.young_modulus_pa);
    vectors.chain(scalars).map(|v| v.to_bits()).collect()
}

#[test]
fn the_liver_refines_merges_back_and_repeats_itself() {
    let (reports, frames, summary) = run();
    assert!((692..=764).contains(&summary.mesh.vertices.start), "728 vertices within 5 %");
    assert!(summary.mesh.vertices.max <= 3456);
    assert!(summary.mesh.splits > 0 && summary.mesh.merges > 0);
    assert_eq!(summary.mesh.vertices.end, summary.mesh.vertices.start);
    assert_eq!(summary.steps.converged, summary.steps.count);
    assert!(summary.steps.residual_max <= 1e-6);
    assert!(summary.mesh.worst_radius_ratio >= 0.6407);
    assert!(summary.mesh.worst_circumradius_over_shortest_edge <= 1.1181);
    assert!(summary.force.max_n > 0.1 && summary.force.end_n == 0.0);
    assert_eq!(summary.inverse.rebuilds, 0);
    assert!(summary.inverse.drift_max < 1e-9);

    let largest =
        |f: &Frame| f.displacement_mm.iter().flatten().fold(0.0, |m: f64, u| m.max(u.abs()));
    assert!(largest(&frames[0]) > 20.0, "pulled");
    assert!(largest(&frames[1]) < 1e-6, "and back at rest");

    let (again, frames_again, _) = run();
    assert_eq!(reports, again);
    for (a, b) in frames.iter().zip(&frames_again) {
        assert_eq!(bits(a), bits(b));
    }
}

/// What an organ of one's own may ask for: stiff vessels, and a pull that goes four times as far.
#[test]
fn stiff_vessels_and_a_long_pull_converge() {
    let far = "tools.0.path=[{ time_s = 0 }, { time_s = 0.5, move_m = [-0.04, 0.1, 0.1] }]";
    for set in ["materials.1.young_modulus_pa=5e6", far] {
        let (scene, _) = scene_file::load("liver", &[set.into()]).unwrap();
        let mut simulation = Simulation::builder(&scene).build().unwrap();
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            assert!(report.converged, "{set}: step {}, residual {}", report.step, report.residual);
        }
    }
}
