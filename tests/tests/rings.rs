//! The hand-over of a split against the plain assembly of both rings.

use faer::Mat;
use nalgebra::{SMatrix, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_embed::{ChildPair, Embedding, LinearTet, P1, RingStiffness, by_name, isotropic};
use yawara_mesh::kuhn::{bisect, bisected_corner};
use yawara_mesh::lattice::Site;
use yawara_mesh::{BisectionForest, Content, MeshDelta, Placement, VertexId};
use yawara_tests::organ::{Organ, organs, ring};
use yawara_tests::rules::rule;
use yawara_tests::stage_suites::element_formulation::check_ring;

fn check(
    forest: &BisectionForest,
    placement: &Placement,
    embedding: &Embedding,
    delta: &MeshDelta,
) -> RingStiffness {
    let ring = ring(forest, placement, embedding, delta);
    check_ring(&P1, &ring, delta, embedding, &|v| placement.position(forest.point(v)));
    ring
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn ring_equals_the_assembly_of_its_tetrahedra(
        organ in organs([2, 1, 1], 3, 0.0..6.0, -0.5..0.49),
        picks in proptest::collection::vec(any::<Index>(), 12),
        number in 0..4usize,
    ) {
        let mut forest = organ.forest(1, 7);
        let placement = organ.placement(7);
        let embedding = organ.embedding_by(rule(number));
        let mut delta = MeshDelta::empty();
        for pick in picks {
            let candidates = forest.candidates();
            forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
            let ring = check(&forest, &placement, &embedding, &delta);
            match number {
                0 => prop_assert_eq!(ring.positive.ncols() + ring.negative.ncols(), 0),
                1 | 2 => prop_assert_eq!(ring.negative.ncols(), 0),
                _ => {
                    let mixed = delta.ring.iter().any(|t| {
                        matches!(t.parent.node.open(), Content::Node(_))
                    });
                    prop_assert_eq!(ring.negative.ncols() > 0, mixed, "exceeds the Voigt bound");
                }
            }
        }
    }

    #[test]
    fn one_material_under_many_labels_stays_itself(
        organ in organs([1, 1, 1], 4, 3.0..4.0, 0.2..0.3),
    ) {
        let mut organ = organ;
        organ.materials = vec![(7e3, 0.41); 4];
        let tree = organ.tree();
        let want = isotropic(7e3, 0.41);
        for name in ["linear", "laminate"] {
            let embedding = organ.embedding(name);
            let mut open: Vec<_> = (0..6).map(|order| tree.root(0, order)).collect();
            let mut seen = 0;
            while let Some(node) = open.pop() {
                prop_assert!((embedding.elasticity(node) - want).amax() <= 1e-12 * want.amax());
                prop_assert!((embedding.density(node) - 1000.0).abs() < 1e-9);
                if let Content::Node(_) = node.open() {
                    seen += 1;
                    open.extend(tree.children(node));
                }
            }
            prop_assert_eq!(seen, tree.node_count());
        }
    }

    #[test]
    fn parents_lie_between_the_bounds(
        organ in organs([1, 1, 1], 3, 0.0..6.0, -0.9..0.49),
    ) {
        // Reuss ≤ laminate ≤ Voigt for every parent against its own halves.
        let tree = organ.tree();
        let embedding = organ.embedding("laminate");
        let mut open: Vec<_> = (0..6).map(|order| tree.root(0, order)).collect();
        while let Some(node) = open.pop() {
            if !matches!(node.open(), Content::Node(_)) {
                continue;
            }
            let [d1, d2] = tree.children(node).map(|half| embedding.elasticity(half));
            let parent = embedding.elasticity(node);
            let voigt = 0.5 * (d1 + d2);
            let reuss =
                2.0 * (d1.try_inverse().unwrap() + d2.try_inverse().unwrap()).try_inverse().unwrap();
            let slack = 1e-9 * voigt.amax();
            prop_assert!((voigt - parent).symmetric_eigenvalues().min() > -slack);
            prop_assert!((parent - reuss).symmetric_eigenvalues().min() > -slack);
            prop_assert!(parent.symmetric_eigenvalues().min() > 0.0);
            open.extend(tree.children(node));
        }
    }

    #[test]
    fn rigid_motions_strain_nothing(
        organ in organs([1, 1, 1], 3, 0.0..6.0, 0.0..0.49),
        pick in any::<Index>(),
        shift in proptest::array::uniform3(-1.0..1.0f64),
        spin in proptest::array::uniform3(-1.0..1.0f64),
        number in 0..3usize,
    ) {
        let mut forest = organ.forest(3, 6);
        let placement = organ.placement(6);
        let embedding = organ.embedding_by(rule(number));
        let mut delta = MeshDelta::empty();
        let candidates = forest.candidates();
        forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
        let ring = ring(&forest, &placement, &embedding, &delta);
        let move_of = |v: VertexId| {
            let x = placement.position(forest.point(v));
            Vector3::from(shift) + Vector3::from(spin).cross(&x)
        };
        let u = Mat::from_fn(3 * ring.vertices.len(), 1, |i, _| {
            move_of(ring.vertices[i / 3])[i % 3]
        });
        for (what, m) in [("k_p", &ring.k_p), ("b", &ring.b), ("positive", &ring.positive)] {
            let force = (m.transpose() * &u).norm_max();
            prop_assert!(force <= 1e-12 * m.norm_max() * u.norm_max(), "{}: {:e}", what, force);
        }
        for tet in &delta.ring {
            let geometry = LinearTet::new(&tet.parent.vertices.map(|v| placement.position(forest.point(v))));
            let x = embedding.combine(tet.parent.node, &geometry, tet.parent.level).1.midpoint;
            let f = geometry.gradient(&tet.parent.vertices.map(move_of));
            let offset = x * yawara_embed::strain_from_gradient(&f);
            prop_assert!(offset.amax() <= 1e-12 * u.norm_max());
        }
    }
}

fn rank(change: &Mat<f64>) -> usize {
    let values = change.singular_values().unwrap();
    values.iter().filter(|&&s| s > 1e-9 * values[0]).count()
}

/// What a tetrahedron with two different halves loses on its own corners when its midpoint is
/// condensed by itself: K_TT − K_p.
fn condensed_loss(corners: &[Vector3<f64>; 4], level: u8, seed: usize) -> SMatrix<f64, 12, 12> {
    let elasticity = [1, 2].map(|half| {
        let t = ((seed * 2 + half) as f64 * 0.618).fract();
        isotropic(1e3 * (1.0 + 4.0 * t), 0.2 + 0.2 * t)
    });
    let (b, middle) = (bisected_corner(level), corners.len());
    let midpoint = 0.5 * (corners[0] + corners[b]);
    let mut loss = -{
        let geometry = LinearTet::new(corners);
        let pair = ChildPair::new(&geometry, 0, b, elasticity);
        geometry.stiffness(&by_name("paper").unwrap().combine(&pair).elasticity)
    };
    for (nodes, d) in bisect(&[0, 1, 2, 3], level, middle).iter().zip(&elasticity) {
        let half = nodes.map(|n| if n == middle { midpoint } else { corners[n] });
        let k = LinearTet::new(&half).stiffness(d);
        for (i, j) in (0..12).flat_map(|i| (0..12).map(move |j| (i, j))) {
            if nodes[i / 3] != middle && nodes[j / 3] != middle {
                loss[(3 * nodes[i / 3] + i % 3, 3 * nodes[j / 3] + j % 3)] += k[(i, j)];
            }
        }
    }
    loss
}

#[test]
fn interior_rings_have_the_known_ranks() {
    // (golden/mesh.json) rank of K_c − K_p on the ring's old degrees of freedom: for one material
    // in the conforming family, and for parents of different halves condensed one by one. (With
    // one material the six tetrahedra around a body diagonal lose two ranks by symmetry.)
    let known = [(Site::CubeCentre, 6, 18), (Site::FaceCentre, 6, 12), (Site::EdgeMidpoint, 6, 24)];
    let organ = Organ::homogeneous([3, 3, 3], 1e3, 0.3);
    let placement = organ.placement(6);
    let mut forest = organ.forest(0, 6);
    let linear = organ.embedding("linear");
    let mut delta = MeshDelta::empty();
    for (site, conforming, condensed) in known {
        let lattice = *forest.domain().lattice();
        let (low, high) = (lattice.units, 2 * lattice.units);
        let mut seen = 0;
        for p in forest.candidates().into_iter().filter(|&p| lattice.site(p).0 == site) {
            forest.split(p, &mut delta).unwrap();
            if !p.iter().all(|&c| c >= low && c <= high) {
                continue;
            }
            let ring = ring(&forest, &placement, &linear, &delta);
            assert_eq!(rank(&(&ring.k_c - &ring.k_p)), conforming);
            let mut isolated = Mat::zeros(ring.k_c.nrows(), ring.k_c.ncols());
            for (number, tet) in delta.ring.iter().map(|t| &t.parent).enumerate() {
                let corners = tet.vertices.map(|v| placement.position(forest.point(v)));
                let loss = condensed_loss(&corners, tet.level, number);
                let rows = tet.vertices.map(|v| ring.vertices.binary_search(&v).unwrap());
                for (i, j) in (0..12).flat_map(|i| (0..12).map(move |j| (i, j))) {
                    isolated[(3 * rows[i / 3] + i % 3, 3 * rows[j / 3] + j % 3)] += loss[(i, j)];
                }
            }
            assert_eq!(rank(&isolated), condensed);
            seen += 1;
        }
        assert!(seen > 0);
    }
}
