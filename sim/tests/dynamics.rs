//! Motion with inertia: what implicit Euler is known to do, done by whole scenes.

use std::f64::consts::PI;

use yawara::report::{Frame, Momentum, StepReport};
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

/// Displacement of the point that was at `rest_mm` off the block's low corner.
fn displacement(frame: &Frame, low: [f64; 3], rest_mm: [f64; 3]) -> [f64; 3] {
    let at = |i: usize| minus(minus(frame.points_mm[i], frame.displacement_mm[i]), low);
    let near = |i: &usize| norm(minus(at(*i), rest_mm)) < 1e-6;
    let found = (0..frame.points_mm.len()).find(near).unwrap();
    frame.displacement_mm[found]
}

fn low_corner(frame: &Frame) -> [f64; 3] {
    std::array::from_fn(|axis| {
        frame.points_mm.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min)
    })
}

const FREE: [&str; 2] = ["fixed=[]", "tools=[]"];
const WEIGHTLESS: &str = "gravity_m_s2=[0.0, 0.0, 0.0]";

#[test]
fn a_falling_body_follows_the_discrete_parabola() {
    for (mass, element) in [("consistent", "p1"), ("lumped", "p1"), ("consistent", "p1p1")] {
        let mass = format!("dynamics.mass={mass}");
        let element = format!("stages.element={element}");
        let start = "dynamics={ velocity_m_s = [0.3, 0.0, 0.1] }";
        let mut set = FREE.to_vec();
        set.extend([start, &mass, &element, "time.step_s=0.01"]);
        let mut simulation = scene("beam", &set);
        run(&mut simulation);
        let frame = simulation.frame().unwrap();
        // v_n = v_0 + n g h and x_n = x_0 + n h v_0 + g h² n (n + 1)/2.
        let (n, h) = (20.0, 0.01);
        let z = 1e3 * (n * h * 0.1 - 9.81 * h * h * n * (n + 1.0) / 2.0);
        for u in &frame.displacement_mm {
            let off = minus(*u, [1e3 * n * h * 0.3, 0.0, z]);
            // 20 steps of residual 1e-6: m c δx ≤ 1e-6 m g, so at most 1e-6 g h² n² a vertex.
            assert!(norm(off) < 1e-6 * 9.81e3 * h * h * n * n, "{mass}: {u:?}, want z = {z}");
        }
        // A block of 160 x 40 x 40 mm of 1000 kg/m³.
        let momentum = simulation.momentum().unwrap();
        assert!((momentum.mass_kg - 0.256).abs() < 1e-12);
        let want = momentum.mass_kg * (0.1 - n * h * 9.81);
        assert!((momentum.linear_n_s[2] - want).abs() < 1e-6 * want.abs());
    }
}

/// A bar that spins about an axis across it, flies and refines; what its momentum loses.
fn spinning(scene_name: &str, more: &[&str]) -> (Momentum, Vec<(StepReport, Momentum)>) {
    let start = "dynamics={ velocity_m_s = [1.0, 0.0, 0.0], spin_rad_s = [0.0, 9.0, 2.0] }";
    let mut set = FREE.to_vec();
    set.extend([start, WEIGHTLESS]);
    set.extend(more);
    let mut simulation = scene(scene_name, &set);
    let start = simulation.momentum().unwrap();
    (start, run(&mut simulation))
}

fn counts(rows: &[(StepReport, Momentum)]) -> (usize, usize) {
    rows.iter().fold((0, 0), |(s, m), (r, _)| (s + r.splits, m + r.merges))
}

#[test]
fn free_flight_keeps_momentum_through_splits_and_merges() {
    // The first bar is drawn out by its spin and comes back; the second scene has tissues of
    // other densities and void, so that mass lies elsewhere after a split.
    let bar = [
        "time.step_s=0.004",
        "time.steps=100",
        "refinement={ split_above = 3e-9, merge_fraction = 0.8 }",
        "stages.indicator=energy",
    ];
    let organ = [
        "image.voxel_mm=4.0",
        "mesh={ base_mm = 32.0, max_level = 4, max_vertices = 500 }",
        "materials.1.density_kg_m3=2500.0",
        "time.step_s=0.01",
        "time.steps=30",
        "refinement={ split_above = 1e-6, merge_fraction = 0.4 }",
        "stages.indicator=energy",
        "stages.element=p1",
    ];
    for (name, more) in [("beam", &bar[..]), ("liver", &organ[..])] {
        for mass in ["consistent", "lumped"] {
            let mass = format!("dynamics.mass={mass}");
            let (start, rows) = spinning(name, &[more, &[&mass]].concat());
            let (splits, merges) = counts(&rows);
            println!("{name}, {mass}: {splits} splits, {merges} merges");
            assert!(splits > 10 && merges > 5, "{name}: {splits} splits, {merges} merges");
            let size = norm(start.linear_n_s);
            let mut worst: f64 = 0.0;
            for (report, now) in &rows {
                let drift = norm(minus(now.linear_n_s, start.linear_n_s));
                // A residual of 1e-6 of forces that are at most m v ω a step; mostly rounding.
                let bound = 1e-6 * 9.0 * size * report.time_s + 1e-12 * size;
                assert!(drift <= bound, "{name}, step {}: {drift:e} of {size:e}", report.step);
                worst = worst.max(drift / size);
            }
            println!("{name}, {mass}: linear momentum within {worst:.1e}");
        }
    }
}

#[test]
fn angular_momentum_fades_with_the_step_to_first_order() {
    // A turn loses h Σ m v'×v a step, (ω h)² of itself.
    let loss = |step_s: f64| {
        let time = [format!("time.step_s={step_s}"), format!("time.steps={}", 0.2 / step_s)];
        let set = [&time[0], &time[1], "mesh.max_level=0", "materials.0.young_modulus_pa=1e6"];
        let (start, rows) = spinning("beam", &set);
        let end = rows.last().unwrap().1;
        (norm(start.angular_n_m_s) - norm(end.angular_n_m_s)) / norm(start.angular_n_m_s)
    };
    let losses = [0.004, 0.002, 0.001].map(loss);
    println!("angular momentum lost in .2 s at 9.2 rad/s with steps of 4, 2, 1 ms: {losses:?}");
    // The component of ω along the bar turns it about a shifted axis: ω² = 85 /s² within a little.
    let want = |h: f64| 1.0 - (1.0 - 85.0 * h * h).powf(0.2 / h);
    for (loss, h) in losses.into_iter().zip([0.004, 0.002, 0.001]) {
        assert!((loss / want(h) - 1.0).abs() < 0.2, "{h} s: {loss}, want {}", want(h));
    }
    assert!((losses[0] / losses[1] / 2.0 - 1.0).abs() < 0.1);
    assert!((losses[1] / losses[2] / 2.0 - 1.0).abs() < 0.1);
}

#[test]
fn a_plucked_cantilever_decays_as_implicit_euler_says() {
    // E = 5e4 Pa, 160 x 40 x 40 mm, 1000 kg/m³, ν = 0: first bending mode.
    let (length, height, density, young): (f64, f64, f64, f64) = (0.16, 0.04, 1000.0, 5e4);
    for mass in ["consistent", "lumped"] {
        let mass = format!("dynamics={{ mass = '{mass}' }}");
        let step_s = 0.02;
        let mut simulation = scene(
            "beam",
            &[
                WEIGHTLESS,
                &mass,
                "time={ steps = 150, step_s = 0.02 }",
                "mesh={ base_mm = 20.0, start_level = 3, max_vertices = 1000 }",
                "materials.0.poisson_ratio=0.0",
                "solver.residual=1e-7",
                // Moved by half a millimetre in a second, which hardly sets it vibrating, let go.
                "tools.0.release_s=1.0",
                "tools.0.path=[{ time_s = 0.0 }, { time_s = 0.9, move_m = [0.0, 0.0, 5e-4] }]",
            ],
        );
        let low = low_corner(&simulation.frame().unwrap());
        let mut tip = Vec::new();
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            assert!(report.converged, "{report:?}");
            // Higher modes are gone after a second, the first one is not.
            if report.time_s > 1.6 {
                let frame = simulation.frame().unwrap();
                tip.push(displacement(&frame, low, [160.0, 20.0, 20.0])[2]);
            }
        }
        // u_n = A ρⁿ cos(nθ + φ) satisfies u_{n+1} = 2ρ cos θ u_n − ρ² u_{n−1}: least squares.
        let (mut n11, mut n12, mut n22, mut r1, mut r2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for w in tip.windows(3) {
            let scale = 1.0 / (w[1] * w[1] + w[0] * w[0]);
            n11 += scale * w[1] * w[1];
            n12 += scale * w[1] * w[0];
            n22 += scale * w[0] * w[0];
            r1 += scale * w[1] * w[2];
            r2 += scale * w[0] * w[2];
        }
        let det = n11 * n22 - n12 * n12;
        let (a, b) = ((r1 * n22 - r2 * n12) / det, (n11 * r2 - n12 * r1) / det);
        let rho = (-b).sqrt();
        let theta = (a / (2.0 * rho)).acos();
        // A mode is multiplied by 1/(1 ± iωh): ρ = 1/√(1 + ω²h²), tan θ = ωh.
        let omega = theta.tan() / step_s;
        let amplification = 1.0 / (1.0 + (omega * step_s).powi(2)).sqrt();
        println!("{mass}: ω = {omega:.4} rad/s, ρ = {rho:.6}, implicit Euler {amplification:.6}");
        assert!((rho / amplification - 1.0).abs() < 2e-3, "{rho} {amplification}");
        let inertia = height * height * height * height / 12.0;
        let euler_bernoulli = (1.875_104f64 / length).powi(2)
            * (young * inertia / (density * height * height)).sqrt();
        // Shear (κ = 5/6, G = E/2) and rotary inertia lower it: 1/ω² gains about a shear beam's
        // (2L/π)² ρ/(κG); Dunkerley.
        let shear = PI / (2.0 * length) * (5.0 / 6.0 * young / 2.0 / density).sqrt();
        let timoshenko = 1.0 / (euler_bernoulli.powi(-2) + shear.powi(-2)).sqrt();
        println!("Euler-Bernoulli {euler_bernoulli:.4}, with shear {timoshenko:.4} rad/s");
        // Four linear tetrahedra over the height are some 10 % too stiff, 5 % in ω.
        assert!(omega > 0.97 * timoshenko && omega < 1.15 * timoshenko, "{omega}");
    }
}

#[test]
fn a_damped_body_comes_to_rest_at_the_quasi_static_solution() {
    let common = ["tools=[]", "time={ steps = 150, step_s = 0.05 }", "solver.residual=1e-8"];
    let still = [&common[..], &["mesh.max_level=0"]].concat();
    let mut quasi_static = scene("beam", &still);
    for _ in 0..3 {
        assert!(quasi_static.step().unwrap().converged);
    }
    let want = quasi_static.frame().unwrap();
    let sag = want.displacement_mm.iter().map(|u| norm(*u)).fold(0.0, f64::max);
    for damping in [
        "dynamics={ damping_mass_per_s = 4.0 }",
        "dynamics={ damping_stiffness_s = 0.1 }",
        "dynamics={ mass = 'lumped', damping_mass_per_s = 4.0, damping_stiffness_s = 0.01 }",
    ] {
        let mut simulation = scene("beam", &[&still[..], &[damping]].concat());
        run(&mut simulation);
        let frame = simulation.frame().unwrap();
        for (got, want) in frame.displacement_mm.iter().zip(&want.displacement_mm) {
            let off = norm(minus(*got, *want));
            assert!(off < 1e-4 * sag, "{damping}: {off} mm of {sag} mm");
        }
    }
}

#[test]
fn damping_by_stiffness_lets_a_rigid_turn_be() {
    // A hundredfold of what stops all vibration at once: a turning bar loses no more for it.
    let lost = |damping: &str| {
        let set = ["mesh.max_level=0", "materials.0.young_modulus_pa=1e6", damping];
        let (start, rows) = spinning("beam", &[&set[..], &["time.step_s=0.002"]].concat());
        1.0 - norm(rows.last().unwrap().1.angular_n_m_s) / norm(start.angular_n_m_s)
    };
    let (without, with) =
        (lost("dynamics.damping_stiffness_s=0.0"), lost("dynamics.damping_stiffness_s=0.1"));
    println!("lost in 20 steps: {without} without damping, {with} with");
    assert!((with - without).abs() < 0.02 * without, "{without} {with}");
    let mass = lost("dynamics.damping_mass_per_s=5.0");
    assert!(mass > 0.15, "damping by mass stops turns too: {mass}");
}

#[test]
fn what_has_no_inertia_or_damping_is_refused_by_name() {
    let refused = |set: &[&str], words: &[&str]| {
        let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
        let message = match scene_file::load("drop", &overrides) {
            Err(error) => error.to_string(),
            Ok((scene, _)) => {
                let stages = Stages::by_name(&scene.stages).unwrap();
                Simulation::new(&scene, stages).err().expect("refused").to_string()
            }
        };
        for word in words {
            assert!(message.contains(word), "no {word:?} in {message}");
        }
    };
    refused(&["materials.0.density_kg_m3=0.0"], &["materials[0].density_kg_m3", "more than 0"]);
    refused(&["dynamics.damping_mass_per_s=nan"], &["dynamics.damping_mass_per_s", "0 to 1e12"]);
    refused(&["dynamics.damping_stiffness_s=-1.0"], &["dynamics.damping_stiffness_s"]);
    refused(&["dynamics.spin_rad_s=[0.0, inf, 0.0]"], &["dynamics.spin_rad_s[1]", "finite"]);
    refused(&["dynamics.mass=heavy"], &["dynamics.mass", "consistent"]);
    refused(
        &["stages.law=linear", "dynamics.damping_stiffness_s=0.01"],
        &["stages.law", "rayleigh"],
    );
    refused(&["stages.integrator=leapfrog"], &["stages.integrator", "implicit_euler"]);
    refused(&["budget.step_ms=0.0"], &["budget.step_ms"]);
    // Without inertia a body that nothing holds is still refused.
    let (mut scene, _) = scene_file::load("drop", &["fixed=[]".into()]).unwrap();
    assert!(Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).is_ok());
    scene.dynamics = None;
    let error = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).err().unwrap();
    assert!(error.to_string().contains("nothing of"), "{error}");
}

#[test]
fn the_plan_names_the_integrator_that_runs() {
    for (name, want) in [("auto", "implicit_euler"), ("newmark", "newmark")] {
        let simulation = scene("drop", &[&format!("stages.integrator={name}")]);
        let row = simulation.plan().iter().find(|row| row.stage == "dynamics").unwrap();
        assert_eq!(row.choice, want);
    }
}
