//! Pressures that follow a slender column far past the load at which a dead one buckles it.

use std::f64::consts::PI;

use yawara::{Simulation, Stages, scene_file};

/// The load that buckles it as a cantilever, π²EI/(4L²), N.
const EULER_N: f64 = 0.012_85;

const LENGTH_M: f64 = 0.16;

/// A column under a pressure on its end of so many of Euler's loads, and a small dead one across. A follower at
/// the end of a column never buckles it in statics (Beck's column: its stiffness is never singular).
fn column(times: f64, element: &str, equilibrium: &str) -> Simulation {
    let end = "{shape='box', min=[1, 0, 0], max=[1, 1, 1]}";
    let face = "{shape='box', min=[0.97, -0.1, -0.1], max=[1.1, 1.1, 1.1]}";
    let (along, across) = (times * EULER_N / 4e-4, 0.05 * EULER_N);
    let tools = format!(
        "tools=[{{kind='pressure', region={face}, pressure=[{{time_s=0, pressure_pa=0}}, {{time_s=1, \
         pressure_pa={along}}}]}}, {{kind='load', region={end}, load=[{{time_s=0}}, {{time_s=1, \
         force_n=[0, 0, {across}]}}]}}]"
    );
    let (element, equilibrium) =
        (format!("stages.element={element}"), format!("stages.equilibrium={equilibrium}"));
    let set = [
        "image.size_mm=[160, 20, 20]",
        "mesh.start_level=3",
        "mesh.max_level=3",
        "gravity_m_s2=[0, 0, 0]",
        "materials.0.young_modulus_pa=1e4",
        "time.steps=24",
        "time.step_s=0.05",
        &element,
        &equilibrium,
        &tools,
    ];
    let (scene, _) = scene_file::load("beam", &set.map(String::from)).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

#[test]
fn a_column_is_followed_to_twenty_times_eulers_load() {
    for (times, element) in [(2.0, "p1"), (2.0, "p1p1"), (20.0, "p1"), (20.0, "p1p1")] {
        let mut simulation = column(times, element, "fallback");
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            assert!(report.converged && report.substeps == 1, "{times} {element}: {report:?}");
            assert!(report.iterations < 30, "{}", report.iterations);
        }
    }
}

/// Runs both to the end and compares the pressure's forces across after each step, and at last all places. Each
/// solution leaves a force of `left` τ S at most, τ the residual and S the norm of the elements' forces: of a cube
/// of six tetrahedra under P it is P/√3, of a column of eight √(8/3) P, below 2 P.
///
/// A force δ across the end turns it by δ L²/2EI and moves it by δ L³/3EI at most, whatever P is: at a distance s
/// from an end that P follows its moment is δ sin(ks)/k, k² = P/EI, which is no more than δ s.
fn assert_alike(pair: &mut [Simulation; 2], times: f64, left: f64) {
    let most = left * 1e-6 * 2.0 * times * EULER_N;
    let turned = PI.powi(2) / 8.0 * most / EULER_N;
    let moved = PI.powi(2) / 12.0 * most / EULER_N * LENGTH_M;
    while pair[0].steps_left() > 0 {
        let [first, second] = pair.each_mut().map(|one| one.step().unwrap());
        assert!(first.converged && second.converged, "{first:?} {second:?}");
        let off = (first.force_n[2] - second.force_n[2]).abs();
        assert!(off < turned * times * EULER_N, "step {}: {off}", first.step);
    }
    let places = pair.each_ref().map(|one| one.body().positions());
    let off = places[0].iter().zip(places[1]).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(off < moved, "{off} {moved}");
}

#[test]
fn both_methods_find_the_same_places() {
    for element in ["p1", "p1p1"] {
        let mut pair = ["fallback", "residual_newton"].map(|name| column(20.0, element, name));
        assert_alike(&mut pair, 20.0, 2.0);
    }
}

/// Quadratic with the whole tangent; without that of the loads, or with its other half, it is not.
#[test]
fn newtons_method_on_the_residual_takes_a_few_iterations_a_step() {
    for element in ["p1", "p1p1"] {
        let mut simulation = column(20.0, element, "residual_newton");
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            assert!(report.converged && report.iterations <= 5, "{report:?}");
        }
    }
}

/// Dead loads, renewed until they change by τ, come to the same: where the end has turned by θ too little, the next
/// ones turn it by (1/cos kL − 1) θ of that, k² = P/EI, and at a quarter of Euler's load kL is π/4: what is left after
/// the last change is (√2 − 1)/(2 − √2) < 1 of it.
#[test]
fn a_small_pressure_may_lag_as_well() {
    let mut pair = ["fallback", "anderson"].map(|name| column(0.25, "p1", name));
    assert_alike(&mut pair, 0.25, 3.0);
}
