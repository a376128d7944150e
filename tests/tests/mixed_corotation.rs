//! Co-rotation of mixed elements against their matrix, written out, and against linear statics.

use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;
use yawara_corot::{
    Anderson, Body, Element, Equilibrium, FORCES, Newton, Problem, Tolerance, check_mixed,
    equilibrium_by_name, forces_by_name, law_by_name,
};
use yawara_embed::{ElementFormulation, MixedModuli, P1P1};
use yawara_mesh::{BisectionForest, Placement};
use yawara_tests::mixed_body::MixedBody;
use yawara_tests::organ::{Organ, elements, organs};

const CARRYING: [&str; 3] = ["element", "element_reference", "none"];

fn body(organ: &Organ, forest: &BisectionForest, placement: &Placement, alpha: f64) -> Body {
    let embedding = organ.embedding("laminate");
    let mut body = Body::mixed(P1P1::new(alpha).unwrap());
    elements(forest, placement, &embedding).for_each(|element| body.insert(element));
    body
}

fn setting(organ: &Organ, alpha: f64) -> (Body, Vec<Vector3<f64>>) {
    let (forest, placement) = (organ.forest(3, 4), organ.placement(4));
    let mut rest = vec![Vector3::zeros(); forest.vertex_capacity()];
    for v in forest.vertices() {
        rest[v.index()] = placement.position(forest.point(v));
    }
    (body(organ, &forest, &placement, alpha), rest)
}

/// Forces, volume residuals and √Σ‖f_e‖².
fn evaluate(name: &str, body: &mut Body, x: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, Vec<f64>, f64) {
    let mut forces = vec![Vector3::repeat(f64::NAN); x.len()];
    let scale = forces_by_name(name).unwrap().internal_forces(body, x, &mut forces);
    let volumes = (0..x.len()).map(|v| body.pressure_residual(v)).collect();
    (forces, volumes, scale)
}

fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| if *value <= most { most } else { value.abs() })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    #[test]
    fn forces_and_volumes_are_those_of_the_element_s_matrix(
        organ in organs([2, 1, 1], 3, 2.0..5.0, 0.0..0.4999),
        noise in proptest::collection::vec(proptest::array::uniform4(-1.0..1.0f64), 61),
        turn in proptest::array::uniform3(-2.0..2.0f64),
        alpha in 0.5..2.0f64,
    ) {
        let (mut body, rest) = setting(&organ, alpha);
        let turn = Rotation3::from_scaled_axis(Vector3::from(turn));
        let x: Vec<_> = rest.iter().enumerate()
            .map(|(i, x)| turn * x + Vector3::from_fn(|k, _| noise[i % 61][k]) * 5e-4)
            .collect();
        for v in 0..x.len() {
            body.set_pressure(v, noise[v % 61][3]);
        }
        let element = P1P1::new(alpha).unwrap();
        for name in CARRYING {
            let (forces, volumes, scale) = evaluate(name, &mut body, &x);
            let mut want = (vec![Vector3::zeros(); x.len()], vec![0.0; x.len()]);
            for (number, e) in body.elements().iter().enumerate() {
                let rotation = body.rotation(number);
                let k = element.stiffness(&e.geometry, &e.elasticity);
                let unknown = |row: usize| {
                    let v = e.vertices[row / 4];
                    let u = rotation.transpose() * x[v] - rest[v];
                    if row % 4 == 3 { noise[v % 61][3] } else { u[row % 4] }
                };
                let product =
                    |row: usize| (0..16).map(|j| k[(row, j)] * unknown(j)).sum::<f64>();
                // The work of the stress, pressures apart, where the rotation turns with F.
                let s = rotation.transpose() * e.deformation_gradient(&x);
                let v = MixedModuli::split(&e.elasticity).deviatoric * e.corotated_strain(&rotation, &x);
                let m = Matrix3::new(v[0], v[3], v[5], v[3], v[1], v[4], v[5], v[4], v[2]) * s;
                let axial = Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12);
                let turning = Matrix3::identity() * s.trace() - 0.5 * (s + s.transpose());
                let b = turning.lu().solve(&axial).unwrap().cross_matrix();
                let turns = name != "none";
                for (i, &v) in e.vertices.iter().enumerate() {
                    if turns {
                        let pull = e.geometry.volume * (rotation * b * e.geometry.gradients[i]);
                        want.0[v] -= pull;
                    }
                    want.0[v] += rotation * Vector3::from_fn(|axis, _| product(4 * i + axis));
                    want.1[v] -= product(4 * i + 3);
                }
            }
            // Positions of 5 cm over edges of 5 mm: rounding grows tenfold at most.
            let bar = 1e-12 * scale.max(body.stiffness_scale() * 0.05);
            prop_assert!(distance(&forces, &want.0) <= bar, "{name}");
            let off: Vec<f64> = volumes.iter().zip(&want.1).map(|(a, b)| a - b).collect();
            // Volumes come with a quarter of an edge of 5 mm or less.
            prop_assert!(largest(&off) <= 5e-3 * bar, "{name}: {:e}", largest(&off));
        }
    }

    #[test]
    fn rigid_motion_costs_nothing_and_turns_what_there_is(
        organ in organs([2, 1, 1], 3, 2.0..5.0, 0.0..0.4999),
        noise in proptest::collection::vec(proptest::array::uniform4(-1.0..1.0f64), 61),
        axis in proptest::array::uniform3(0.1..1.0f64),
        shift in proptest::array::uniform3(-0.1..0.1f64),
    ) {
        let (mut body, rest) = setting(&organ, 1.0);
        let axis = nalgebra::Unit::new_normalize(Vector3::from(axis));
        let turn = Rotation3::from_axis_angle(&axis, 170f64.to_radians());
        let moved = |x: &Vector3<f64>| turn * x + Vector3::from(shift);
        for name in ["element", "element_reference"] {
            body.set_pressures(&[]);
            let x: Vec<_> = rest.iter().map(moved).collect();
            let bar = 1e-12 * body.stiffness_scale() * 0.2;
            let (forces, volumes, _) = evaluate(name, &mut body, &x);
            prop_assert!(forces.iter().all(|f| f.norm() <= bar), "{name}");
            prop_assert!(largest(&volumes) <= 5e-3 * bar, "{name}");

            for v in 0..x.len() {
                body.set_pressure(v, 1e-2 * noise[v % 61][3]);
            }
            let x: Vec<_> = rest.iter().enumerate()
                .map(|(i, x)| x + Vector3::from_fn(|k, _| noise[i % 61][k]) * 2e-4)
                .collect();
            let (here, volumes, scale) = evaluate(name, &mut body, &x);
            let there: Vec<_> = x.iter().map(moved).collect();
            let (got, same, _) = evaluate(name, &mut body, &there);
            let here: Vec<_> = here.iter().map(|f| turn * f).collect();
            // Rounding of positions is that of the stiff part, however small the forces.
            let bar = bar + 1e-10 * scale;
            prop_assert!(distance(&here, &got) <= bar, "{name}: {:e}, want {bar:e}, forces {scale:e}", distance(&here, &got));
            let off: Vec<f64> = volumes.iter().zip(&same).map(|(a, b)| a - b).collect();
            prop_assert!(largest(&off) <= 5e-3 * bar, "{name}");
        }
    }
}

#[test]
fn forces_balance_in_sum_and_in_torque() {
    let (mut body, rest) = setting(&Organ::homogeneous([6, 1, 1], 1e4, 0.49), 1.0);
    let x: Vec<_> = rest
        .iter()
        .map(|x| x + Vector3::new(0.02 * (60.0 * x.y).sin(), 3.0 * x.x * x.x, -8.0 * x.x * x.y))
        .collect();
    for v in 0..x.len() {
        body.set_pressure(v, 0.3 * (v as f64).sin());
    }
    for name in ["element", "element_reference"] {
        let (forces, _, scale) = evaluate(name, &mut body, &x);
        let size = x.iter().map(Vector3::norm).fold(0.0, f64::max);
        let torque: Vector3<f64> = x.iter().zip(&forces).map(|(x, f)| x.cross(f)).sum();
        assert!(forces.iter().sum::<Vector3<f64>>().norm() < 1e-13 * scale, "{name}");
        assert!(torque.norm() < 1e-13 * scale * size, "{name}: {torque:e}");
    }
}

#[test]
fn a_small_load_gives_what_linear_statics_gives() {
    for poisson_ratio in [0.3, 0.499] {
        let organ = Organ::homogeneous([3, 1, 1], 1e4, poisson_ratio);
        let mut linear = MixedBody::new(&organ, "laminate", "sparse", 6);
        for pick in 0..12 {
            linear.split(|count| 7 * pick % count);
        }
        let (forest, placement) = (&linear.forest, organ.placement(6));
        let n = forest.vertex_capacity();
        let mut rest = vec![Vector3::zeros(); n];
        let (mut free, mut external) = (vec![false; n], vec![Vector3::zeros(); n]);
        for &v in linear.vertices() {
            rest[v.index()] = placement.position(forest.point(v));
            free[v.index()] = !linear.is_held(v);
            if free[v.index()] {
                external[v.index()] = Vector3::new(1e-9, 0.0, -2e-9);
            }
        }
        let select = |f: &[f64], y: &mut [f64]| {
            let at = |slot: usize| 4 * linear.vertices()[slot].index();
            let load: Vec<f64> =
                (0..4 * linear.vertices().len()).map(|i| f[at(i / 4) + i % 4]).collect();
            let mut u = vec![0.0; load.len()];
            linear.maintainer.solve(&load, &mut u).unwrap();
            u.iter().enumerate().for_each(|(i, u)| y[at(i / 4) + i % 4] = *u);
        };
        let load: Vec<f64> = external.iter().flat_map(|f| [f.x, f.y, f.z, 0.0]).collect();
        let mut want = vec![0.0; 4 * n];
        select(&load, &mut want);

        for name in CARRYING {
            let mut body = body(&organ, forest, &placement, 1.0);
            let (mut x, mut internal) = (rest.clone(), external.clone());
            let corotation = forces_by_name(name).unwrap();
            let mut problem = Problem {
                body: &mut body,
                forces: corotation.as_ref(),
                inertia: None,
                external: &external,
                free: &free,
                constraints: None,
                pushes: None,
                following: &[],
                inverse: &select,
            };
            let tolerance = Tolerance::new(1e-7, 20);
            let outcome =
                Anderson::default().solve(&mut problem, &mut x, &mut internal, &tolerance);
            assert!(outcome.converged && outcome.iterations <= 3, "{name}: {outcome:?}");
            let sizes = [0, 3].map(|part| {
                let pick = |i: &usize| (i % 4 == 3) == (part == 3);
                let got = |i: usize| match i % 4 {
                    3 => body.pressure(i / 4),
                    axis => x[i / 4][axis] - rest[i / 4][axis],
                };
                let square = |f: &dyn Fn(usize) -> f64| {
                    (0..4 * n).filter(pick).map(|i| f(i).powi(2)).sum::<f64>().sqrt()
                };
                (square(&|i| got(i) - want[i]), square(&|i| want[i]))
            });
            // Strains of 10⁻⁷, so that turning changes the seventh digit, as the residual does.
            for (error, size) in sizes {
                assert!(error < 1e-5 * size, "{name}, {poisson_ratio}: {error:e} of {size:e}");
            }
        }
    }
}

/// The elements of `of` under a law in an empty body.
fn under(law: &str, empty: Body, of: &Body) -> Body {
    let mut body = empty.with_law(law_by_name(law, 0.0).unwrap());
    of.elements().iter().for_each(|element| body.insert(*element));
    body
}

/// Where all strain is the same the pressures that fit it give each element the forces and the energy that it has
/// without.
#[test]
fn a_law_with_a_growth_of_its_own_knows_no_pressure_where_it_is_homogeneous() {
    for (name, poisson_ratio) in CARRYING.iter().zip([0.3, 0.45, 0.4]) {
        let organ = Organ::homogeneous([2, 1, 1], 1e4, poisson_ratio);
        let (linear, rest) = setting(&organ, 1.0);
        let mut alone = under("neo_hookean", Body::new(), &linear);
        let mut pressed = under("neo_hookean", Body::mixed(P1P1::default()), &linear);
        let f = Matrix3::new(1.9, 0.3, 0.0, -0.2, 0.7, 0.1, 0.0, 0.4, 0.8);
        let x: Vec<_> = rest.iter().map(|x| f * x).collect();
        // With no rotation growth is that of the symmetric part.
        let stretch = if *name == "none" { 0.5 * (f + f.transpose()) } else { f };
        let growth = stretch.determinant() - 1.0;
        let MixedModuli { bulk, shear, .. } =
            MixedModuli::new(&linear.elements()[0].elasticity).unwrap();
        pressed.set_pressures(&vec![bulk / shear * growth; x.len()]);
        let (want, _, scale) = evaluate(name, &mut alone, &x);
        let (got, residuals, _) = evaluate(name, &mut pressed, &x);
        assert!(distance(&got, &want) < 1e-12 * scale, "{name}: {}", distance(&got, &want));
        let volume: f64 = linear.elements().iter().map(|e| e.geometry.volume).sum();
        assert!(largest(&residuals) < 1e-12 * shear * volume, "{name}: {}", largest(&residuals));
        let [have, want] = [pressed.energy(&x), alone.energy(&x)];
        assert!((have - want).abs() < 1e-12 * want, "{name}: {have} J, want {want} J");
    }
}

/// A bar is bent far in one jump, of a material that hardly changes its volume: by the exact tangent with
/// pressures a few steps are enough, the last of them quadratic. The kept inverse is not used.
#[test]
fn newton_bends_a_mixed_bar() {
    let cases = [
        ("element", 0.3, "linear"),
        ("element", 0.499, "linear"),
        ("none", 0.45, "linear"),
        ("element", 0.3, "neo_hookean"),
        ("element", 0.499, "neo_hookean"),
    ];
    for (name, poisson_ratio, law) in cases {
        let organ = Organ::homogeneous([4, 1, 1], 1e4, poisson_ratio);
        let (linear, mut x) = setting(&organ, 1.0);
        let mut body = under(law, Body::mixed(P1P1::default()), &linear);
        let (rest, n) = (x.clone(), x.len());
        let [low, high] =
            [f64::min, f64::max].map(|of| rest.iter().map(|x| x.x).reduce(of).unwrap());
        let far = high - low;
        let free: Vec<bool> = rest.iter().map(|x| x.x > low + 1e-9 * far).collect();
        let at_end = |x: &Vector3<f64>| x.x > high - 1e-9 * far;
        let ends = rest.iter().filter(|x| at_end(x)).count() as f64;
        // P L²/(E I) = 1.
        let width = far / 4.0;
        let total = 1e4 * width.powi(4) / 12.0 / far.powi(2);
        let load = |x: &Vector3<f64>| if at_end(x) { total / ends } else { 0.0 };
        let external: Vec<_> = rest.iter().map(|x| Vector3::new(0.0, 0.0, load(x))).collect();
        let forces = forces_by_name(name).unwrap();
        let mut sizes = Vec::new();
        let mut internal = external.clone();
        for most in 1.. {
            let mut problem = Problem {
                body: &mut body,
                forces: forces.as_ref(),
                inertia: None,
                external: &external,
                free: &free,
                constraints: None,
                pushes: None,
                following: &[],
                inverse: &|_: &[f64], y: &mut [f64]| y.fill(f64::NAN),
            };
            // Well above rounding, which ends what is quadratic.
            let tolerance = Tolerance::new(1e-9, most);
            x.copy_from_slice(&rest);
            problem.body.set_pressures(&vec![0.0; n]);
            let outcome = Newton::default().solve(&mut problem, &mut x, &mut internal, &tolerance);
            sizes.push(outcome.residual);
            if outcome.converged {
                break;
            }
            assert!(most < 20, "{name}, {poisson_ratio}: {sizes:?}");
        }
        let moved = x.iter().zip(&rest).map(|(x, rest)| x.z - rest.z).fold(0.0, f64::max);
        assert!(moved > 0.05 * far, "{name}, {poisson_ratio}: {moved} of {far}");
        if let [.., before, last] = sizes[..] {
            assert!(last < 1e-3 * before, "{name}, {poisson_ratio}: {sizes:?}");
        }
    }
}

/// What a solve keeps for the next one is used where it fits and nowhere else: whatever was solved before, a solve ends
/// in the same digits.
#[test]
fn newton_solves_bodies_in_turn_as_it_solves_each_alone() {
    let solve = |newton: &mut Newton, cells: [usize; 3], both_ends: bool, is_mixed: bool| {
        let organ = Organ::homogeneous(cells, 1e4, 0.3);
        let (linear, mut x) = setting(&organ, 1.0);
        let made = if is_mixed { Body::mixed(P1P1::default()) } else { Body::new() };
        let mut body = under("linear", made, &linear);
        let [low, high] = [f64::min, f64::max].map(|of| x.iter().map(|x| x.x).reduce(of).unwrap());
        let near = 1e-9 * (high - low);
        let is_free = |x: &Vector3<f64>| x.x > low + near && !(both_ends && x.x > high - near);
        let free: Vec<bool> = x.iter().map(is_free).collect();
        let external = vec![Vector3::new(0.0, 0.0, 1e-3); x.len()];
        let mut internal = external.clone();
        let forces = forces_by_name("element").unwrap();
        let mut problem = Problem {
            body: &mut body,
            forces: forces.as_ref(),
            inertia: None,
            external: &external,
            free: &free,
            constraints: None,
            pushes: None,
            following: &[],
            inverse: &|_: &[f64], y: &mut [f64]| y.fill(f64::NAN),
        };
        let outcome = newton.solve(&mut problem, &mut x, &mut internal, &Tolerance::new(1e-9, 20));
        assert!(outcome.converged, "{}", outcome.residual);
        x
    };
    let mut newton = Newton::default();
    let long = [4, 1, 1];
    let turns = [
        (long, false, true),
        (long, false, true),
        (long, true, true),
        (long, false, false),
        (long, true, false),
        ([3, 1, 1], true, false),
        (long, false, true),
    ];
    for (cells, both_ends, is_mixed) in turns {
        let alone = solve(&mut Newton::default(), cells, both_ends, is_mixed);
        assert_eq!(solve(&mut newton, cells, both_ends, is_mixed), alone);
    }
}

#[test]
fn what_can_t_take_pressures_says_so() {
    let fallback = equilibrium_by_name("fallback").unwrap();
    for name in FORCES {
        let corotation = forces_by_name(name).unwrap();
        let answer = check_mixed(corotation.as_ref(), fallback.as_ref());
        assert_eq!(answer.is_ok(), CARRYING.contains(name), "{name}");
    }
    let element = forces_by_name("element").unwrap();
    let name = "lbfgs";
    let mut solver = equilibrium_by_name(name).unwrap();
    let answer = check_mixed(element.as_ref(), solver.as_ref());
    assert!(answer.unwrap_err().to_string().contains(name));

    let (mut body, mut x) = setting(&Organ::homogeneous([1, 1, 1], 1e4, 0.45), 1.0);
    x.iter_mut().for_each(|x| x.y *= 1.1);
    let (start, n) = (x.clone(), x.len());
    let (external, free) = (vec![Vector3::zeros(); n], vec![true; n]);
    let mut problem = Problem {
        body: &mut body,
        forces: element.as_ref(),
        inertia: None,
        external: &external,
        free: &free,
        constraints: None,
        pushes: None,
        following: &[],
        inverse: &|_: &[f64], y: &mut [f64]| y.fill(f64::NAN),
    };
    let tolerance = Tolerance::new(1e-6, 20);
    let mut internal = external.clone();
    let outcome = solver.solve(&mut problem, &mut x, &mut internal, &tolerance);
    assert!(!outcome.converged && outcome.iterations == 0 && x == start, "{name}");
}

#[test]
fn what_is_no_elasticity_gives_forces_that_are_no_numbers() {
    let (mut body, rest) = setting(&Organ::homogeneous([1, 1, 1], 1e4, 0.3), 1.0);
    let element = Element { elasticity: -body.elements()[0].elasticity, ..body.elements()[0] };
    body.insert(element);
    for name in CARRYING {
        let (_, _, scale) = evaluate(name, &mut body, &rest);
        assert!(scale.is_nan(), "{name}: {scale}");
    }
}
