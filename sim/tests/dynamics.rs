//! Motion with inertia: what implicit Euler is known to do, done by whole scenes.

use yawara::report::{Momentum, StepReport};
use yawara::{Simulation, Stages, scene_file};

/// A scene with these settings, before its first step.
fn scene(name: &str, set: &[&str]) -> Simulation {
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load(name, &overrides).unwrap();
    Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
}

/// All steps, each with the momentum after it.
fn run(simulation: &mut Simulation) -> Vec<(StepReport, Momentum)> {
    let mut rows = Vec::new();
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{report:?}");
        rows.push((report, simulation.momentum().unwrap()));
    }
    rows
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

const FREE: [&str; 2] = ["fixed=[]", "tools=[]"];
const WEIGHTLESS: &str = "gravity_m_s2=[0.0, 0.0, 0.0]";

#[test]
fn a_falling_body_follows_the_discrete_parabola() {
    for mass in ["consistent", "lumped"] {
        let mass = format!("dynamics.mass={mass}");
        let set = [&FREE[..], &["dynamics={ velocity_m_s = [0.3, 0.0, 0.1] }", &mass]].concat();
        let mut simulation = scene("beam", &[&set[..], &["time.step_s=0.01"]].concat());
        run(&mut simulation);
        let frame = simulation.frame().unwrap();
        // v_n = v_0 + n g h and x_n = x_0 + n h v_0 + g h² n (n + 1)/2.
        let (n, h) = (20.0, 0.01);
        let z = 1e3 * (n * h * 0.1 - 9.81 * h * h * n * (n + 1.0) / 2.0);
        for u in &frame.displacement_mm {
            let off = minus(*u, [1e3 * n * h * 0.3, 0.0, z]);
            assert!(norm(off) < 1e-6, "{mass}: {u:?}, want z = {z}");
        }
        // A block of 160 x 40 x 40 mm of 1000 kg/m³.
        let momentum = simulation.momentum().unwrap();
        assert!((momentum.mass_kg - 0.256).abs() < 1e-12);
        let want = momentum.mass_kg * (0.1 - n * h * 9.81);
        assert!((momentum.linear_n_s[2] - want).abs() < 1e-6 * want.abs());
    }
}

#[test]
fn free_flight_keeps_momentum_through_splits_and_merges() {
    let spin = "dynamics={ velocity_m_s = [1.0, 0.0, 0.0], spin_rad_s = [0.0, 9.0, 2.0] }";
    let settings = ["time.step_s=0.005", "time.steps=60", "refinement.split_above=2e-7"];
    let set = [&FREE[..], &settings, &[spin, WEIGHTLESS]].concat();
    let mut simulation = scene("beam", &set);
    let start = simulation.momentum().unwrap();
    let rows = run(&mut simulation);
    let count = |of: fn(&StepReport) -> usize| rows.iter().map(|(r, _)| of(r)).sum::<usize>();
    println!("{} splits, {} merges", count(|r| r.splits), count(|r| r.merges));
    for (report, m) in &rows {
        println!("{} {} {} {:?} {:e}", report.step, report.vertices, report.iterations, m, report.residual);
    }
    println!("{start:?}");
}
