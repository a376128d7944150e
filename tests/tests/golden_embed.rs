//! Element matrices, homogenised parents, volumes and rotations against an independent
//! prototype (`golden/embed.json`; its `literal` is the choice `paper`).

use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix, Vector3};
use serde_json::Value;
use yawara::indicator::child_volume_ratios;
use yawara_corot::rotation::{polar_cold, polar_warm};
use yawara_embed::{ChildPair, LinearTet, by_name, isotropic};

fn golden() -> Value {
    serde_json::from_str(include_str!("../golden/embed.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(rows) => rows.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows = value.as_array().unwrap().len();
    let all = numbers(value);
    DMatrix::from_row_slice(rows, all.len() / rows, &all)
}

fn matrix3(value: &Value) -> Matrix3<f64> {
    Matrix3::from_row_slice(&numbers(value))
}

fn dynamic<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |i, j| m[(i, j)])
}

/// The prototype prints 15 decimals of numbers of the size of its largest entry.
fn assert_close(got: &DMatrix<f64>, want: &DMatrix<f64>, what: &str) {
    assert_eq!(got.shape(), want.shape(), "{what}");
    let error = (got - want).amax() / want.amax();
    assert!(error < 4e-14, "{what}: {error:e}");
}

/// (name, corners a, b, c, d) of both shapes.
fn tets(golden: &Value) -> Vec<(String, [Vector3<f64>; 4], &Value)> {
    let tets = golden["tets"].as_object().unwrap();
    tets.iter()
        .map(|(name, tet)| {
            let x = numbers(&tet["X"]);
            let corner = |i: usize| Vector3::new(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
            (name.clone(), std::array::from_fn(corner), tet)
        })
        .collect()
}

/// Parses "literal;E1=1;E2=10;nu=0.3".
fn case(name: &str) -> (&str, [Matrix6<f64>; 2]) {
    let parts: Vec<&str> = name.split(';').collect();
    let value = |i: usize| parts[i].split_once('=').unwrap().1.parse::<f64>().unwrap();
    let choice = if parts[0] == "literal" { "paper" } else { parts[0] };
    (choice, [isotropic(value(1), value(3)), isotropic(value(2), value(3))])
}

#[test]
fn elasticity_matrices() {
    let golden = golden();
    let cases = golden["D"].as_object().unwrap();
    assert_eq!(cases.len(), 4);
    for (name, want) in cases {
        let value = |part: &str| part.split_once('=').unwrap().1.parse::<f64>().unwrap();
        let (young, poisson) = name.split_once(',').unwrap();
        let d = isotropic(value(young), value(poisson));
        assert_close(&dynamic(&d), &matrix(want), name);
    }
}

#[test]
fn element_stiffness_and_pairs_of_halves() {
    let golden = golden();
    for (name, x, tet) in tets(&golden) {
        let k = LinearTet::new(&x).stiffness(&isotropic(1.0, 0.3));
        assert_close(&dynamic(&k), &matrix(&tet["K_E1_nu0p3"]), &name);
        let middle = 0.5 * (x[0] + x[1]);
        for (case_name, want) in tet["cases"].as_object().unwrap() {
            if want["K15"].is_null() {
                continue;
            }
            let (_, [d1, d2]) = case(case_name);
            let mut k15 = DMatrix::zeros(15, 15);
            let halves = [([0, 4, 2, 3], d1), ([4, 1, 2, 3], d2)];
            for (nodes, d) in halves {
                let corners = nodes.map(|n: usize| if n == 4 { middle } else { x[n] });
                let k = LinearTet::new(&corners).stiffness(&d);
                for i in 0..12 {
                    for j in 0..12 {
                        k15[(3 * nodes[i / 3] + i % 3, 3 * nodes[j / 3] + j % 3)] += k[(i, j)];
                    }
                }
            }
            assert_close(&k15, &matrix(&want["K15"]), case_name);
        }
    }
}

#[test]
fn homogenised_parents_and_midpoints() {
    let golden = golden();
    let mut count = 0;
    for (shape, x, tet) in tets(&golden) {
        let geometry = LinearTet::new(&x);
        let b = geometry.strain_matrix();
        for (name, want) in tet["cases"].as_object().unwrap() {
            let (choice, elasticity) = case(name);
            let pair = ChildPair::new(&geometry, 0, 1, elasticity);
            let parent = by_name(choice).unwrap().combine(&pair);
            let k_p = geometry.stiffness(&parent.elasticity);
            assert_close(&dynamic(&k_p), &matrix(&want["K_p"]), &format!("{shape} {name} K_p"));
            let mut h = parent.midpoint * b;
            for axis in 0..3 {
                h[(axis, axis)] += 0.5;
                h[(axis, 3 + axis)] += 0.5;
            }
            assert_close(&dynamic(&h), &matrix(&want["H_M"]), &format!("{shape} {name} H_M"));
            count += 1;
        }
    }
    assert_eq!(count, 18);
}

#[test]
fn volume_ratios_of_halves() {
    let golden = golden();
    for (name, x, tet) in tets(&golden) {
        let geometry = LinearTet::new(&x);
        let moved = numbers(&tet["volume"]["x"]);
        let moved: [Vector3<f64>; 4] =
            std::array::from_fn(|i| Vector3::from_column_slice(&moved[3 * i..3 * i + 3]));
        let offset = Vector3::from_column_slice(&numbers(&tet["volume"]["d"]));
        let pair = ChildPair::new(&geometry, 0, 1, [Matrix6::identity(); 2]);
        let f = geometry.gradient(&moved);
        let ratios = child_volume_ratios(&f, &offset, &pair.midpoint_gradients);
        let want = numbers(&tet["volume"]["ratios"]);
        for (got, want) in ratios.iter().zip(&want) {
            assert!((got - want).abs() < 1e-14, "{name}: {got} {want}");
        }
        // And what they stand for: volumes of the halves themselves.
        let middle = 0.5 * (moved[0] + moved[1]) + offset;
        let volume = |x: [Vector3<f64>; 4]| (x[1] - x[0]).cross(&(x[2] - x[0])).dot(&(x[3] - x[0]));
        let first = volume([moved[0], middle, moved[2], moved[3]]);
        assert!((ratios[0] - first / (0.5 * volume(x))).abs() < 1e-14);
    }
}

#[test]
fn rotations() {
    let golden = golden();
    let mut cases = vec![&golden["polar_inverted"]];
    cases.extend(golden["tets"].as_object().unwrap().values().map(|tet| &tet["polar"]));
    assert_eq!(cases.len(), 3);
    for case in cases {
        let (f, want) = (matrix3(&case["F"]), matrix3(&case["R"]));
        for r in [polar_cold(&f), polar_warm(&f, &Matrix3::identity())] {
            assert!((r - want).amax() < 1e-14, "{r} {want}");
        }
    }
}
