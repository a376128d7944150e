//! The haptic loop keeps time with a device while the solver goes on, and says how it went.

use yawara::haptic::{self, HapticOptions};
use yawara::{SimError, Simulation, Stages, VirtualCoupling, scene_file};

fn simulation() -> Simulation {
    let set: Vec<String> = vec!["mesh.max_level=0".into()];
    let (scene, _) = scene_file::load("indent", &set).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

#[test]
fn a_hand_that_presses_feels_the_body() {
    let mut simulation = simulation();
    // From the surface two millimetres down within half a second, and there.
    let mut device = |t: f64| [0.0, 0.0, 0.04 - 0.002 * (2.0 * t).min(1.0)];
    let options = HapticOptions { seconds: 1.0, ..HapticOptions::default() };
    let summary = haptic::run(&mut simulation, &mut device, &options).unwrap();
    assert!(summary.steps > 3 && summary.converged > 3, "{summary:?}");
    assert!(summary.ticks > 100 && summary.ticks <= 1001 + 200, "{}", summary.ticks);
    assert!(summary.force_max_n > 0.05, "{}", summary.force_max_n);
    assert!((0.0..=100.0).contains(&summary.late_percent));
    assert!(summary.period_ms.p50 >= 0.5 && summary.period_ms.p50 < 50.0);
    assert!(summary.age_ms.p50 > 0.0 && summary.age_ms.p50 <= summary.age_ms.p99);
    assert_eq!(summary.damping_limit_n_s_m, 0.5 * 500.0 * 1e-3 + 0.1);
    assert!(summary.is_passive);
}

#[test]
fn what_no_loop_can_do_is_refused() {
    let mut simulation = simulation();
    let mut device = |_: f64| [0.0; 3];
    let good = HapticOptions { seconds: 0.01, ..HapticOptions::default() };
    for wrong in [
        HapticOptions { seconds: f64::NAN, ..good },
        HapticOptions { period_s: 0.0, ..good },
        HapticOptions {
            coupling: VirtualCoupling { stiffness_n_m: f64::INFINITY, damping_n_s_m: 0.0 },
            ..good
        },
    ] {
        let error = haptic::run(&mut simulation, &mut device, &wrong).unwrap_err();
        assert!(matches!(error, SimError::Value { .. }), "{error}");
    }
    let missing = HapticOptions { tool: 7, ..good };
    let error = haptic::run(&mut simulation, &mut device, &missing).unwrap_err();
    assert!(matches!(error, SimError::NoSuchTool { tool: 7, .. }), "{error}");
}
