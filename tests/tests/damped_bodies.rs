//! Bodies of either element under `rayleigh`: the effective matrix, decay, cost, momentum.

use nalgebra::{DVector, Vector3};
use yawara::report::StepReport;
use yawara::{Simulation, Stages, scene_file};
use yawara_corot::{
    Body, ElementCorotation, ImplicitEuler, Inertia, TimeIntegrator, TimeStep, VertexMotion,
    forces_with_inertia,
};
use yawara_embed::{Mass, P1P1, StepWeights, dynamic_by_name};
use yawara_tests::stage_suites::block::{block_under, moved, waves};

/// f and, in a mixed body, −(P q − G u), vertex-major.
fn rows(body: &mut Body, inertia: &Inertia, x: &[Vector3<f64>]) -> DVector<f64> {
    let mut forces = vec![Vector3::zeros(); x.len()];
    forces_with_inertia(&ElementCorotation, Some(inertia), body, x, &mut forces);
    let m = body.unknowns_per_vertex();
    DVector::from_fn(m * x.len(), |i, _| match i % m {
        3 => -body.pressure_residual(i / m),
        axis => forces[i / m][axis],
    })
}

#[test]
fn the_derivative_at_rest_is_the_effective_matrix() {
    let density = 1000.0;
    let step = TimeStep { length_s: 0.1, damping_mass_per_s: 2.0 };
    for (name, empty) in [("p1", Body::new()), ("p1p1", Body::mixed(P1P1::default()))] {
        for mass in [Mass::Consistent, Mass::Lumped] {
            let (mut body, rest) = block_under("rayleigh", empty.clone());
            let (n, m) = (rest.len(), body.unknowns_per_vertex());
            let zero = Vector3::zeros();
            let still = |x: &Vector3<f64>| VertexMotion {
                position: *x,
                velocity: zero,
                acceleration: zero,
            };
            let start = rest.iter().map(still);
            let inertia =
                Inertia::new(&ImplicitEuler, &step, mass, &body, start, |_| density).unwrap();
            let c = ImplicitEuler.mass_per_s2(&step).unwrap();
            let weights = StepWeights::new(mass, c, body.stiffening()).unwrap();
            assert_eq!(body.stiffening(), 1.5, "1 + β/h");
            let (u, q) = (waves(n), |v: usize| (0.9 * v as f64).cos());
            let element = dynamic_by_name(name, weights).unwrap();
            let mut want = DVector::zeros(m * n);
            for e in body.elements() {
                let k = element.matrix(&e.geometry, &e.elasticity, density);
                let row = |i: usize| m * e.vertices[i / m] + i % m;
                for (i, j) in (0..4 * m).flat_map(|i| (0..4 * m).map(move |j| (i, j))) {
                    let v = e.vertices[j / m];
                    let moves = if j % m == 3 { q(v) } else { u[v][j % m] };
                    want[row(i)] += k[(i, j)] * moves;
                }
            }
            // Central differences by ∛ε: the error is of order ε^⅔.
            let s = f64::EPSILON.cbrt();
            let [up, down] = [s, -s].map(|s| {
                body.set_pressures(&(0..n).map(|v| s * q(v)).collect::<Vec<_>>());
                rows(&mut body, &inertia, &moved(&rest, s, &u))
            });
            let off = ((up - down) / (2.0 * s) - &want).norm() / want.norm();
            assert!(off <= 1e3 * s * s, "{name}, {mass:?}: off by {off:e}");
        }
    }
}

/// All steps of `beam` at ν = .3 on one mesh, under its weight alone; and its largest sag after each,
/// mm.
fn sagging(element: &str, damping_s: f64, gravity: f64) -> (Vec<StepReport>, Vec<f64>) {
    let set = [
        format!("stages.element={element}"),
        format!("dynamics={{ damping_stiffness_s = {damping_s} }}"),
        format!("gravity_m_s2=[0.0, 0.0, -{gravity}]"),
        "tools=[]".into(),
        "mesh.start_level=3".into(),
        "mesh.max_level=3".into(),
        "time={ steps = 40, step_s = 0.02 }".into(),
        "solver.residual=1e-8".into(),
    ];
    let (scene, _) = scene_file::load("beam", &set).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    let (mut reports, mut sags) = (Vec::new(), Vec::new());
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{element}: {report:?}");
        let frame = simulation.frame().unwrap();
        reports.push(report);
        sags.push(frame.displacement_mm.iter().map(|u| -u[2]).fold(0.0, f64::max));
    }
    (reports, sags)
}

/// ω² of the first mode from a decay u_{n+1} = 2 ρ cos θ u_n − ρ² u_{n−1} about its mean: from ρ, and
/// from ρ cos θ. Implicit Euler with damping βK makes ρ e^{iθ} a root of
/// (1 + (h² + βh) ω²) z² − (2 + βh ω²) z + 1. Units: h and β in s.
fn omega_squared(sags: &[f64], h: f64, beta: f64) -> [f64; 2] {
    // Differences know no mean.
    let d: Vec<f64> = sags.windows(2).map(|w| w[1] - w[0]).collect();
    let rows: Vec<_> = d.windows(3).skip(5).map(|w| [w[1], w[0], w[2]]).collect();
    let sum = |i: usize, j: usize| rows.iter().map(|r| r[i] * r[j]).sum::<f64>();
    let det = sum(0, 0) * sum(1, 1) - sum(0, 1).powi(2);
    let a = (sum(0, 2) * sum(1, 1) - sum(1, 2) * sum(0, 1)) / det;
    let b = (sum(1, 2) * sum(0, 0) - sum(0, 2) * sum(0, 1)) / det;
    [(-1.0 / b - 1.0) / (h * h + beta * h), (-a / b - 2.0) / (beta * h)]
}

#[test]
fn both_elements_decay_as_rayleigh_says_and_alike() {
    let (h, beta) = (0.02, 0.02);
    let [p1, mixed] = ["p1", "p1p1"].map(|element| {
        let [by_ratio, by_angle] = omega_squared(&sagging(element, beta, 0.01).1, h, beta);
        println!("{element}: ω = {} or {} rad/s", by_ratio.sqrt(), by_angle.sqrt());
        // The weight is small enough for linear theory. What is left of other modes is damped
        // more than ten times as fast.
        assert!((by_ratio / by_angle - 1.0).abs() < 0.01, "{element}: {by_ratio} {by_angle}");
        by_ratio.sqrt()
    });
    // Bending locks p1 a little more than p1p1 on so coarse a mesh.
    assert!(mixed <= p1 && mixed > 0.96 * p1, "p1 {p1}, p1p1 {mixed} rad/s");
}

#[test]
fn damping_costs_no_more_than_two_iterations_a_step() {
    for element in ["p1", "p1p1"] {
        let mean = |beta| {
            let (reports, _) = sagging(element, beta, 9.81);
            reports.iter().map(|r| r.iterations).sum::<usize>() as f64 / reports.len() as f64
        };
        let (without, with) = (mean(0.0), mean(0.02));
        println!("{element}: {without} iterations a step without damping, {with} with");
        assert!(with <= without + 2.0, "{element}: {with} iterations a step, {without} without");
    }
}

#[test]
fn damped_bodies_in_free_flight_keep_their_linear_momentum() {
    for element in ["p1", "p1p1"] {
        let set = [
            format!("stages.element={element}"),
            "dynamics={ velocity_m_s = [1.0, 0.0, 0.0], spin_rad_s = [0.0, 9.0, 2.0], \
             damping_stiffness_s = 0.01 }"
                .into(),
            "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
            "fixed=[]".into(),
            "tools=[]".into(),
            "mesh.max_level=0".into(),
            "time.step_s=0.004".into(),
        ];
        let (scene, _) = scene_file::load("beam", &set).unwrap();
        let stages = Stages::by_name(&scene.stages).unwrap();
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        let linear = |s: &Simulation| Vector3::from(s.momentum().unwrap().linear_n_s);
        let start = linear(&simulation);
        while simulation.steps_left() > 0 {
            let report = simulation.step().unwrap();
            let drift = (linear(&simulation) - start).norm();
            // A residual of 1e-6 of forces that are at most m v ω a step; rounding is less.
            let bound = start.norm() * (1e-6 * 9.3 * report.time_s + 1e-12);
            assert!(report.converged && drift <= bound, "{element}: {drift:e} N s of {start}");
        }
    }
}
