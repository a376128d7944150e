//! The error estimate against the error itself, and refinement to a target.

use nalgebra::Vector3;
use yawara::report::StepReport;
use yawara::{Simulation, Stages, scene_file};

/// The step in which the beam is pulled farthest.
const FARTHEST: usize = 10;

fn farthest(set: &[String]) -> StepReport {
    let (scene, _) = scene_file::load("beam", set).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let mut last = StepReport::default();
    for _ in 0..FARTHEST {
        last = simulation.step().unwrap();
        assert!(last.converged, "{last:?}");
    }
    last
}

fn uniform(element: &str, level: u8) -> StepReport {
    farthest(&[
        format!("mesh.start_level={level}"),
        format!("mesh.max_level={level}"),
        "mesh.max_vertices=9000".into(),
        format!("stages.element={element}"),
        // On a mesh that stays it is measured where a frame is written.
        format!("output.frames_every={FARTHEST}"),
    ])
}

fn force(report: &StepReport) -> f64 {
    Vector3::from(report.force_n).norm()
}

/// The force of the beam's tool is to its limit as the energy is, which levels of half the edge give by
/// Richardson's rule.
#[test]
fn the_estimate_is_the_error_within_a_factor_on_every_uniform_mesh() {
    let mut limits = Vec::new();
    for element in ["p1", "p1p1"] {
        let runs: Vec<StepReport> = (0..=6).map(|level| uniform(element, level)).collect();
        let forces: Vec<f64> = runs.iter().map(force).collect();
        assert!(forces.is_sorted_by(|a, b| a > b), "{element}: {forces:?}");
        let [first, second] = [forces[0] - forces[3], forces[3] - forces[6]];
        let limit = forces[6] - second * second / (first - second);
        limits.push(limit);
        for (level, report) in runs.iter().enumerate() {
            let error = force(report) / limit - 1.0;
            let ratio = report.error_estimate.unwrap() / error;
            println!("{element}, level {level}: {error:.4}, estimate over it {ratio:.2}");
            assert!(0.8 < ratio && ratio < 1.3, "{element}, level {level}: {ratio}");
        }
    }
    assert!((limits[0] / limits[1] - 1.0).abs() < 0.005, "{limits:?}");
}

#[test]
fn a_mesh_is_refined_until_the_estimate_is_the_target() {
    let mut before = 0;
    for target in [0.09, 0.06, 0.035] {
        let report = farthest(&[format!("refinement.target={target}")]);
        let estimate = report.error_estimate.unwrap();
        // The last step's own growth is answered in the next.
        assert!(estimate < 1.1 * target, "{estimate} where {target} was asked for");
        assert!(report.vertices > before, "{target}: {} vertices", report.vertices);
        before = report.vertices;
    }
}

/// On a mesh that stays the estimate costs something in steps with a frame alone, and is none of the others.
#[test]
fn a_fixed_mesh_is_measured_where_a_frame_is_written() {
    for (every, want) in [(3, vec![3, 6, 7]), (0, vec![7])] {
        let set = ["mesh.max_level=0".into(), "time.steps=7".into()];
        let set = [&set[..], &[format!("output.frames_every={every}")]].concat();
        let (scene, _) = scene_file::load("beam", &set).unwrap();
        let stages = Stages::by_name(&scene.stages).unwrap();
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        let mut measured = Vec::new();
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            measured.extend(report.error_estimate.map(|_| report.step));
        }
        assert_eq!(measured, want, "frames every {every}");
    }
}

#[test]
fn an_indicator_that_is_no_energy_asks_for_a_threshold() {
    let (scene, _) = scene_file::load("beam", &["stages.indicator=volume".into()]).unwrap();
    let built = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap());
    let error = built.err().unwrap().to_string();
    for words in ["beam", "refinement.split_above", "volume"] {
        assert!(error.contains(words), "{error}");
    }
}
