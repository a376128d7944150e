//! Every co-rotation against its formula, written out with element matrices, and what each of them
//! gets wrong.

use nalgebra::{Matrix3, Rotation3, SVector, Vector3};
use proptest::prelude::*;
use yawara_corot::{Body, Element, ElementCorotation, FORCES, InternalForces, forces_by_name};
use yawara_embed::MixedModuli;
use yawara_tests::organ::{Organ, elements, organs};

fn setting(organ: &Organ) -> (Body, Vec<Vector3<f64>>) {
    let (forest, placement) = (organ.forest(3, 4), organ.placement(4));
    let embedding = organ.embedding("laminate");
    let mut body = Body::new();
    elements(&forest, &placement, &embedding).for_each(|element| body.insert(element));
    let mut rest = vec![Vector3::zeros(); forest.vertex_capacity()];
    for v in forest.vertices() {
        rest[v.index()] = placement.position(forest.point(v));
    }
    (body, rest)
}

fn forces(name: &str, body: &mut Body, x: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, f64) {
    let mut forces = vec![Vector3::repeat(f64::NAN); x.len()];
    let scale = forces_by_name(name).unwrap().internal_forces(body, x, &mut forces);
    (forces, scale)
}

/// Σ_e A_i K_e u, with the co-rotated displacements u of the corners as corner i sees them.
fn by_matrices(
    body: &Body,
    vertices: usize,
    frame: impl Fn(&Element, usize) -> Matrix3<f64>,
    displacement: impl Fn(&Element, usize, usize) -> Vector3<f64>,
) -> Vec<Vector3<f64>> {
    let mut forces = vec![Vector3::zeros(); vertices];
    for e in body.elements() {
        let k = e.geometry.stiffness(&e.elasticity);
        for i in 0..4 {
            let u = SVector::<f64, 12>::from_fn(|row, _| displacement(e, i, row / 3)[row % 3]);
            forces[e.vertices[i]] += frame(e, i) * (k * u).fixed_rows::<3>(3 * i);
        }
    }
    forces
}

fn rotation(body: &Body, element: &Element) -> Matrix3<f64> {
    body.rotation(body.number(element.tet).unwrap())
}

/// −Σ V R b× ∇λ_i, (tr(S)I − S) b = axial(σ S − S σ): what the turning of R with F adds to R K_e u.
fn by_turning(body: &Body, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut forces = vec![Vector3::zeros(); x.len()];
    for (number, e) in body.elements().iter().enumerate() {
        let rotation = body.rotation(number);
        let s = rotation.transpose() * e.deformation_gradient(x);
        let v = e.elasticity * e.corotated_strain(&rotation, x);
        let sigma = Matrix3::new(v[0], v[3], v[5], v[3], v[1], v[4], v[5], v[4], v[2]);
        let m = sigma * s;
        let axial = Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12);
        let turning = Matrix3::identity() * s.trace() - 0.5 * (s + s.transpose());
        let b = turning.lu().solve(&axial).unwrap().cross_matrix();
        for (v, gradient) in e.vertices.iter().zip(&e.geometry.gradients) {
            forces[*v] -= e.geometry.volume * (rotation * b * gradient);
        }
    }
    forces
}

/// k (‖x_b − x_a‖ − L) along the edges of each element, k = E V/L².
fn by_springs(body: &Body, rest: &[Vector3<f64>], x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut forces = vec![Vector3::zeros(); x.len()];
    for e in body.elements() {
        let MixedModuli { bulk, shear, .. } = MixedModuli::new(&e.elasticity).unwrap();
        let modulus = 9.0 * bulk * shear / (3.0 * bulk + shear);
        for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let (a, b) = (e.vertices[a], e.vertices[b]);
            let (length, edge) = ((rest[b] - rest[a]).norm(), x[b] - x[a]);
            let stiffness = modulus * e.geometry.volume / length.powi(2);
            let pull = stiffness * (edge.norm() - length) * edge.normalize();
            forces[a] -= pull;
            forces[b] += pull;
        }
    }
    forces
}

fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    #[test]
    fn forces_are_those_of_the_formulas(
        organ in organs([2, 1, 1], 3, 2.0..5.0, 0.0..0.49),
        noise in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 61),
        turn in proptest::array::uniform3(-2.0..2.0f64),
    ) {
        let (mut body, rest) = setting(&organ);
        let turn = Rotation3::from_scaled_axis(Vector3::from(turn));
        let x: Vec<_> = rest.iter().enumerate()
            .map(|(i, x)| turn * x + Vector3::from(noise[i % 61]) * 5e-4)
            .collect();
        for name in FORCES {
            let (got, scale) = forces(name, &mut body, &x);
            let n = x.len();
            let vertex = body.vertex_rotations();
            let want = match *name {
                "mass_spring" => by_springs(&body, &rest, &x),
                "none" => by_matrices(&body, n, |_, _| Matrix3::identity(), |e, _, j| {
                    x[e.vertices[j]] - rest[e.vertices[j]]
                }),
                "paper" => by_matrices(&body, n, |e, i| vertex[e.vertices[i]], |e, _, j| {
                    vertex[e.vertices[j]].transpose() * x[e.vertices[j]] - rest[e.vertices[j]]
                }),
                "row" => by_matrices(&body, n, |e, i| vertex[e.vertices[i]], |e, i, j| {
                    vertex[e.vertices[i]].transpose() * x[e.vertices[j]] - rest[e.vertices[j]]
                }),
                _ => by_matrices(&body, n, |e, _| rotation(&body, e), |e, _, j| {
                    rotation(&body, e).transpose() * x[e.vertices[j]] - rest[e.vertices[j]]
                }),
            };
            let turning = match *name {
                "element" | "element_reference" => by_turning(&body, &x),
                _ => vec![Vector3::zeros(); n],
            };
            let want: Vec<_> = want.iter().zip(turning).map(|(a, b)| a + b).collect();
            // Positions of 5 cm over edges of 5 mm: rounding grows tenfold at most.
            let bar = 1e-12 * scale.max(body.stiffness_scale() * 0.05);
            prop_assert!(distance(&got, &want) <= bar, "{name}: {:e}", distance(&got, &want));
        }
    }

    #[test]
    fn without_rotation_all_are_linear_elasticity_but_for_the_turning(
        organ in organs([2, 1, 1], 3, 2.0..5.0, 0.0..0.49),
        strain in proptest::array::uniform6(-0.2..0.2f64),
    ) {
        let (mut body, rest) = setting(&organ);
        let [a, b, c, d, e, f] = strain;
        let stretch = Matrix3::identity() + Matrix3::new(a, d, e, d, b, f, e, f, c);
        let x: Vec<_> = rest.iter().map(|x| stretch * x).collect();
        let (want, scale) = forces("none", &mut body, &x);
        // Springs are another material.
        for name in FORCES.iter().filter(|name| **name != "mass_spring") {
            let (got, _) = forces(name, &mut body, &x);
            let got: Vec<_> = match *name {
                "element" | "element_reference" => {
                    got.iter().zip(by_turning(&body, &x)).map(|(a, b)| a - b).collect()
                }
                _ => got,
            };
            prop_assert!(distance(&got, &want) <= 1e-11 * scale, "{name}");
        }
    }
}

/// A homogeneous beam of 6 × 1 × 1 cells, bent along a circle's arc by `angle`.
fn bent_beam(angle: f64) -> (Body, Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let (body, rest) = setting(&Organ::homogeneous([6, 1, 1], 1e4, 0.3));
    let length = rest.iter().map(|x| x.x).fold(0.0, f64::max);
    let bend = |x: &Vector3<f64>| {
        let (sin, cos) = (angle * x.x / length).sin_cos();
        let radius = length / angle;
        Vector3::new((radius - x.z) * sin, x.y, radius - (radius - x.z) * cos)
    };
    let x = rest.iter().map(bend).collect();
    (body, rest, x)
}

#[test]
fn moving_the_body_changes_the_paper_s_forces_alone() {
    let (mut body, _, x) = bent_beam(0.5);
    // By its own length, 60 mm.
    let moved: Vec<_> = x.iter().map(|x| x + Vector3::new(0.04, 0.03, -0.03)).collect();
    for name in ["element", "row", "paper"] {
        let ((here, scale), (there, _)) =
            (forces(name, &mut body, &x), forces(name, &mut body, &moved));
        let change = distance(&here, &there) / scale;
        println!("{name}: forces change by {change:.1e} of the element forces");
        if name == "paper" {
            assert!(change > 1.0, "{change}");
        } else {
            assert!(change < 1e-10, "{name}: {change}");
        }
    }
}

#[test]
fn turning_the_body_turns_the_forces_of_all_but_linear_elasticity() {
    let (mut body, _, x) = bent_beam(0.5);
    let turn = Rotation3::from_scaled_axis(Vector3::new(0.4, -1.1, 0.7));
    let turned: Vec<_> = x.iter().map(|x| turn * x).collect();
    for name in FORCES {
        let (here, scale) = forces(name, &mut body, &x);
        let here: Vec<_> = here.iter().map(|f| turn * f).collect();
        let (there, _) = forces(name, &mut body, &turned);
        let change = distance(&here, &there) / scale;
        assert!(if *name == "none" { change > 0.1 } else { change < 1e-10 }, "{name}: {change}");
    }
}

#[test]
fn rows_leave_ghost_forces_where_elements_leave_none() {
    let (mut body, _, x) = bent_beam(std::f64::consts::FRAC_PI_2);
    let mut net = |name: &str| {
        let (f, scale) = forces(name, &mut body, &x);
        let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
        let torque: Vector3<f64> = x.iter().zip(&f).map(|(x, f)| x.cross(f)).sum();
        [f.iter().sum::<Vector3<f64>>().norm() / scale, torque.norm() / (scale * size)]
    };
    let (element, row) = (net("element"), net("row"));
    println!("net force and torque: element {element:?}, row {row:?}");
    assert!(element.iter().all(|&x| x < 1e-13), "{element:?}");
    assert!(row.iter().all(|&x| x > 1e-4), "{row:?}");
}

#[test]
fn what_is_not_finite_stays_visible() {
    let (mut body, mut rest) = setting(&Organ::homogeneous([1, 1, 1], 1e4, 0.3));
    rest[3].y = f64::NAN;
    for name in FORCES {
        let (got, scale) = forces(name, &mut body, &rest);
        assert!(!scale.is_finite() && got.iter().any(|f| !f.y.is_finite()), "{name}");
    }
    assert!(body.elements().iter().all(|e| rotation(&body, e).iter().all(|r| r.is_finite())));
    let mut sum = vec![Vector3::zeros(); rest.len()];
    rest[3].y = 0.0;
    assert!(ElementCorotation.internal_forces(&mut body, &rest, &mut sum).is_finite());
}
