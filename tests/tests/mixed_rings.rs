//! The mixed element's matrices and hand-over against plain assembly and closed forms.

use faer::Mat;
use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector4};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_embed::{
    ElementFormulation, Embedding, LinearTet, MixedModuli, P1P1, RingStiffness, isotropic,
    strain_from_gradient,
};
use yawara_mesh::kuhn::Point;
use yawara_mesh::lattice::Site;
use yawara_mesh::{BisectionForest, MeshDelta, Placement, Tet, VertexId};
use yawara_tests::organ::{Organ, organs};
use yawara_tests::rules::rule;
use yawara_tests::stage_suites::element_formulation::{assemble, check_ring};

/// Unknowns per vertex.
const M: usize = 4;

fn dense(m: &Mat<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

fn ring(
    element: &P1P1,
    forest: &BisectionForest,
    placement: &Placement,
    embedding: &Embedding,
    delta: &MeshDelta,
) -> RingStiffness {
    element.ring(delta, embedding, &|v| placement.position(forest.point(v)))
}

/// M = F Fᵀ − N Nᵀ − b A22⁻¹ bᵀ.
fn change(ring: &RingStiffness) -> DMatrix<f64> {
    let [a22, b, f, n] = [&ring.a22, &ring.b, &ring.positive, &ring.negative].map(dense);
    &f * f.transpose() - &n * n.transpose() - &b * a22.try_inverse().unwrap() * b.transpose()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn rigid_motions_strain_nothing(
        organ in organs([1, 1, 1], 3, 0.0..6.0, 0.0..0.4999),
        pick in any::<Index>(),
        shift in proptest::array::uniform3(-1.0..1.0f64),
        spin in proptest::array::uniform3(-1.0..1.0f64),
        number in 0..4usize,
    ) {
        let mut forest = organ.forest(3, 6);
        let placement = organ.placement(6);
        let embedding = organ.embedding_by(rule(number));
        let mut delta = MeshDelta::empty();
        let candidates = forest.candidates();
        forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
        let ring = ring(&P1P1::default(), &forest, &placement, &embedding, &delta);
        let u = DMatrix::from_fn(M * ring.vertices.len(), 1, |i, _| {
            let x = placement.position(forest.point(ring.vertices[i / M]));
            let moved = Vector3::from(shift) + Vector3::from(spin).cross(&x);
            if i % M == 3 { 0.0 } else { moved[i % M] }
        });
        let parts = [
            ("k_p", &ring.k_p), ("b", &ring.b),
            ("positive", &ring.positive), ("negative", &ring.negative),
        ];
        for (what, m) in parts.map(|(what, m)| (what, dense(m))) {
            if m.ncols() > 0 {
                let force = (m.transpose() * &u).amax();
                prop_assert!(force <= 1e-12 * m.amax() * u.amax(), "{}: {:e}", what, force);
            }
        }
    }

    #[test]
    fn anisotropic_moduli_leave_a_semidefinite_rest(
        entries in proptest::collection::vec(-1.0..1.0f64, 36),
        exponent in -3.0..6.0f64,
    ) {
        let root = Matrix6::from_row_slice(&entries);
        let d = (root * root.transpose() + Matrix6::identity() * 0.01) * 10f64.powf(exponent);
        let split = MixedModuli::new(&d).unwrap();
        let m = nalgebra::Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0);
        let pressed = d.try_inverse().unwrap() * m;
        prop_assert!((split.bulk * m.dot(&pressed) - 1.0).abs() < 1e-9);
        prop_assert!(split.deviatoric.symmetric_eigenvalues().min() > -1e-12 * d.amax());
        // Singular along D⁻¹m, and nowhere else.
        prop_assert!((split.deviatoric * pressed).amax() < 1e-9 * d.amax() * pressed.amax());
        let values = split.deviatoric.symmetric_eigenvalues();
        prop_assert_eq!(values.iter().filter(|&&v| v < 1e-9 * d.amax()).count(), 1);
        prop_assert!((split.deviatoric + split.bulk * m * m.transpose() - d).amax() < 1e-12 * d.amax());
        prop_assert!(split.shear > 0.0);
    }
}

#[test]
fn isotropic_moduli_are_the_textbook_s() {
    for (young, nu) in [(1.0, 0.0), (1.0, 0.3), (1e3, 0.45), (7e5, 0.49), (3.0, -0.5)] {
        let (bulk, shear) = (young / (3.0 * (1.0 - 2.0 * nu)), young / (2.0 * (1.0 + nu)));
        let split = MixedModuli::new(&isotropic(young, nu)).unwrap();
        assert!((split.bulk / bulk - 1.0).abs() < 1e-13, "{split:?}");
        assert!((split.shear / shear - 1.0).abs() < 1e-12, "{split:?}");
        // D' = 2G on the deviator's normal part, G on engineering shears.
        let want = Matrix6::from_fn(|i, j| match (i < 3 && j < 3, i == j) {
            (true, true) => 4.0 / 3.0 * shear,
            (true, false) => -2.0 / 3.0 * shear,
            (false, true) => shear,
            _ => 0.0,
        });
        assert!((split.deviatoric - want).amax() < 1e-12 * shear.max(bulk), "{split:?}");
    }
    for bad in [Matrix6::zeros(), -isotropic(1.0, 0.3), Matrix6::repeat(f64::NAN)] {
        assert!(MixedModuli::new(&bad).is_err());
    }
    let mut skew = isotropic(1.0, 0.3);
    skew[(0, 3)] = 0.1;
    assert!(MixedModuli::new(&skew).unwrap_err().to_string().contains("symmetric"));
    for alpha in [0.49, 2.01, f64::NAN, f64::INFINITY] {
        assert!(P1P1::new(alpha).is_err());
    }
}

#[test]
fn one_tetrahedron_by_hand() {
    // Corners 0, e_x, e_y, e_z: V = 1/6, ∇λ = (−1,−1,−1), e_x, e_y, e_z; E = 2.6, ν = .3: μ = 1,
    // κ = 13/6, so that μ²/κ = 6/13. Under u = ε x the pressure row is μ V/4 tr ε.
    let corners = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
    let geometry = LinearTet::new(&corners);
    let k = P1P1::default().stiffness(&geometry, &isotropic(2.6, 0.3));
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-14, "{a} {b}");
    // q row of corner 0 against x of corners 0 and 1: ∓ 1/24.
    close(k[(3, 0)], -1.0 / 24.0);
    close(k[(3, 4)], 1.0 / 24.0);
    close(k[(4, 3)], 1.0 / 24.0);
    // P = (1/120) [2·6/13 + 3/4] on the diagonal, (1/120) [6/13 − 1/4] beside it.
    close(k[(3, 3)], -(12.0 / 13.0 + 0.75) / 120.0);
    close(k[(3, 7)], -(6.0 / 13.0 - 0.25) / 120.0);
    // K' of corner 1 along x: V D'₁₁ = (1/6)(4/3); along y: V D'₄₄.
    close(k[(4, 4)], 4.0 / 18.0);
    close(k[(5, 5)], 1.0 / 6.0);
    // Eliminating a constant q leaves V BᵀDB: uᵀKu of a dilation u = x is V mᵀDm = V 9 κ.
    let u: Vec<f64> =
        (0..16).map(|i| if i % 4 == 3 { 0.0 } else { corners[i / 4][i % 4] }).collect();
    let q = 13.0 / 6.0 * 3.0;
    let full: Vec<f64> = (0..16).map(|i| if i % 4 == 3 { q } else { u[i] }).collect();
    let force: Vec<f64> = (0..16).map(|i| (0..16).map(|j| k[(i, j)] * full[j]).sum()).collect();
    (0..4).for_each(|corner| close(force[4 * corner + 3], 0.0));
    let energy: f64 = (0..16).map(|i| u[i] * force[i]).sum();
    assert!((energy - 9.0 * 13.0 / 36.0).abs() < 1e-13, "{energy}");
}

/// Signs of the eigenvalues above 1e-9 of the largest, with rows in units of their diagonal.
fn signature(m: &DMatrix<f64>, scale: &DMatrix<f64>) -> [usize; 2] {
    let unit = |i: usize| scale[(i, i)].abs().sqrt();
    let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] / unit(i) / unit(j));
    let values = (&scaled + scaled.transpose()).symmetric_eigenvalues();
    let count = |sign: f64| values.iter().filter(|&&v| sign * v > 1e-9 * values.amax()).count();
    [count(1.0), count(-1.0)]
}

#[test]
fn interior_rings_have_the_known_ranks() {
    // One material: two positive and three negative. All different: as many as the old unknowns
    // without the six rigid motions, 26, 18 and 34 after 8, 6 and 10 vertices.
    let known = [(Site::CubeCentre, 26), (Site::FaceCentre, 18), (Site::EdgeMidpoint, 34)];
    let mut organ = Organ::homogeneous([3, 3, 3], 1e3, 0.45);
    let placement = organ.placement(6);
    for homogeneous in [true, false] {
        if !homogeneous {
            let pick = |i: usize| (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 61;
            (0..organ.labels.len()).for_each(|i| organ.labels[i] = 1 + pick(i) as u16);
            organ.materials =
                (0..8).map(|i| (1e3 * (1.0 + i as f64), 0.2 + 0.03 * i as f64)).collect();
        }
        let embedding = organ.embedding("laminate");
        let mut forest = organ.forest(0, 6);
        let lattice = *forest.domain().lattice();
        let (low, high) = (lattice.units, 2 * lattice.units);
        let mut delta = MeshDelta::empty();
        for (site, most) in known {
            let (mut seen, mut reached) = (0, 0);
            for p in forest.candidates().into_iter().filter(|&p| lattice.site(p).0 == site) {
                forest.split(p, &mut delta).unwrap();
                if !p.iter().all(|&c| c >= low && c <= high) {
                    continue;
                }
                let element = P1P1::default();
                let ring = ring(&element, &forest, &placement, &embedding, &delta);
                let position = |v: VertexId| placement.position(forest.point(v));
                let coarse = check_ring(&element, &ring, &delta, &embedding, &position);
                let signs = signature(&change(&ring), &coarse);
                if homogeneous {
                    assert_eq!(signs, [2, 3], "{site:?}");
                    assert_eq!([ring.positive.ncols(), ring.negative.ncols()], [1, 0]);
                }
                assert!(signs[0] + signs[1] <= most, "{site:?}: {signs:?}");
                reached = reached.max(signs[0] + signs[1]);
                seen += 1;
            }
            assert!(seen > 0);
            assert!(homogeneous || reached == most, "{site:?}: {reached} of {most}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    #[test]
    fn patch_test(
        picks in proptest::collection::vec(any::<Index>(), 25),
        strain in proptest::array::uniform9(-1.0..1.0f64),
        poisson in -0.5..0.4999f64,
        laminate in any::<bool>(),
    ) {
        // A linear field on the boundary is a linear field inside, with the pressure κ tr ε: on
        // any refined mesh.
        let mut organ = Organ::homogeneous([2, 1, 1], 4e3, poisson);
        organ.labels.iter_mut().enumerate().for_each(|(i, label)| *label += (i % 3 == 0) as u16);
        organ.materials.push((4e3, poisson));
        let embedding = organ.embedding(if laminate { "laminate" } else { "linear" });
        let mut forest = organ.forest(3, 7);
        let mut delta = MeshDelta::empty();
        for pick in &picks {
            let candidates = forest.candidates();
            forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
        }
        let placement = organ.placement(7);
        let position = |v: VertexId| placement.position(forest.point(v));
        let vertices: Vec<VertexId> = forest.vertices().collect();
        let tets: Vec<Tet> = forest.leaves().collect();
        let k = assemble(&P1P1::default(), &vertices, tets.iter(), &embedding, &position);
        let mut outer = vec![false; forest.vertex_capacity()];
        forest.boundary_faces().into_iter().flatten().for_each(|v| outer[v.index()] = true);
        let field = Matrix3::from_row_slice(&strain);
        let split = MixedModuli::new(&isotropic(4e3, poisson)).unwrap();
        let e = strain_from_gradient(&field);
        let q = split.bulk / split.shear * (e[0] + e[1] + e[2]);
        let exact = |i: usize| match i % M {
            3 => q,
            axis => (field * position(vertices[i / M]))[axis],
        };
        let given = |i: usize| i % M < 3 && outer[vertices[i / M].index()];
        let inner: Vec<usize> = (0..k.nrows()).filter(|&i| !given(i)).collect();
        let load = DMatrix::from_fn(inner.len(), 1, |i, _| {
            -(0..k.nrows()).filter(|&j| given(j)).map(|j| k[(inner[i], j)] * exact(j)).sum::<f64>()
        });
        let part = DMatrix::from_fn(inner.len(), inner.len(), |i, j| k[(inner[i], inner[j])]);
        let solved = part.lu().solve(&load).unwrap();
        let size = vertices.iter().map(|&v| position(v).amax()).fold(0.0, f64::max);
        for (i, &row) in inner.iter().enumerate() {
            let (error, unit) = ((solved[(i, 0)] - exact(row)).abs(), if row % M == 3 { 1.0 + q.abs() } else { size });
            prop_assert!(error <= 1e-9 * unit, "row {}: {:e} of {:e}", row, error, unit);
        }
    }
}

#[test]
fn a_clamped_ring_still_belongs_together() {
    // M is the same in factors and in parts, however many ends of the edge are held.
    let mut organ = Organ::homogeneous([2, 1, 1], 1e3, 0.49);
    (0..organ.labels.len()).for_each(|i| organ.labels[i] = 1 + (i * 7 % 3 == 0) as u16);
    organ.materials.push((1e5, 0.4));
    let mut forest = organ.forest(5, 6);
    let placement = organ.placement(6);
    let embedding = organ.embedding("laminate");
    let mut delta = MeshDelta::empty();
    let mut seen = [0; 2];
    let mut ends_held = [0; 3];
    for p in forest.candidates() {
        if forest.split(p, &mut delta).is_err() {
            continue;
        }
        let is_in = |p: Point| 4 * p[0] <= forest.domain().lattice().units;
        let held = |v: VertexId| is_in(forest.point(v));
        let new_is_held = is_in(p);
        let ring = ring(&P1P1::default(), &forest, &placement, &embedding, &delta).clamp(
            held,
            new_is_held,
            50.0,
        );
        let [k_p, k_c, a12, a22, b, f, n] =
            [&ring.k_p, &ring.k_c, &ring.a12, &ring.a22, &ring.b, &ring.positive, &ring.negative]
                .map(dense);
        let inverse = a22.clone().try_inverse().unwrap();
        let condensed = &k_c - &a12 * &inverse * a12.transpose() - &k_p;
        let factored = &f * f.transpose() - &n * n.transpose() - &b * inverse * b.transpose();
        assert!((condensed - factored).amax() < 1e-12 * k_c.amax());
        for (i, &v) in ring.vertices.iter().enumerate() {
            let rows = k_c.rows(M * i, 3);
            assert_eq!(held(v), rows.amax() == 0.0);
            assert!(k_p[(M * i + 3, M * i + 3)] < 0.0, "its pressure stays");
        }
        let diagonal = Vector4::from_fn(|i, _| a22[(i, i)]);
        assert!(diagonal[3] < 0.0 && diagonal.rows(0, 3).min() > 0.0);
        assert_eq!(new_is_held, diagonal.rows(0, 3) == Vector3::repeat(50.0));
        seen[usize::from(new_is_held)] += 1;
        if new_is_held {
            ends_held[delta.edge.iter().filter(|&&v| held(v)).count()] += 1;
        }
    }
    assert!(seen[0] > 0 && seen[1] > 0);
    assert!(ends_held[1] > 0 && ends_held[2] > 0, "{ends_held:?}");
}
