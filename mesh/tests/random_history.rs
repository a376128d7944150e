//! Long random histories of splits and merges keep the mesh valid and reversible.

use std::sync::Arc;

use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::kuhn::signed_volume6;
use yawara_mesh::{
    BisectionForest, Domain, LabelTree, Lattice, MeshDelta, Placement, Quality, VertexId,
    geometry::FACES,
};

/// A forest on a box of cells, some of them cut out.
fn forest(cells: [usize; 3], cut_out: &[usize], start: u8, max: u8) -> BisectionForest {
    let mut domain = Domain::full(Lattice::new(cells, max));
    domain.exclude(cut_out);
    BisectionForest::new(domain, Arc::new(LabelTree::homogeneous(cells, 1)), start, max).unwrap()
}

/// A face in lattice points, and the leaf corner opposite to it.
type FaceSide = ([[i32; 3]; 3], [i32; 3]);

/// Every face belongs to two leaves on opposite sides, or to one and then lies on the hull of
/// the domain: no hanging vertex, no crack. Volumes are positive and fill the domain.
fn assert_conforming(f: &BisectionForest) {
    let lattice = f.domain().lattice();
    let mut volume = 0;
    let mut faces: Vec<FaceSide> = Vec::new();
    for tet in f.leaves() {
        let corners = tet.vertices.map(|v| f.point(v));
        let v = signed_volume6(&corners).abs();
        assert!(v > 0);
        volume += v;
        for (opposite, face) in FACES.iter().enumerate() {
            let mut points = face.map(|i| corners[i]);
            points.sort_unstable();
            faces.push((points, corners[opposite]));
        }
    }
    let cell = 6 * i64::from(lattice.units).pow(3);
    assert_eq!(volume, cell * f.domain().cells().count() as i64);
    faces.sort_unstable();
    let mut single = 0;
    for same in faces.chunk_by(|a, b| a.0 == b.0) {
        match same {
            [one] => {
                assert!(on_hull(f, &one.0), "hanging face {:?}", one.0);
                single += 1;
            }
            [one, two] => {
                let side = |p| signed_volume6(&[one.0[0], one.0[1], one.0[2], p]).signum();
                assert_eq!(side(one.1), -side(two.1));
            }
            more => panic!("{} leaves share a face", more.len()),
        }
    }
    // The hull that splits and merges keep up to date is the one found by pairing all faces.
    let mut hull: Vec<[[i32; 3]; 3]> = f
        .boundary_faces()
        .into_iter()
        .map(|face| {
            let mut points = face.map(|v| f.point(v));
            points.sort_unstable();
            points
        })
        .collect();
    hull.sort_unstable();
    hull.dedup();
    assert_eq!(hull.len(), single);
    for face in &hull {
        let at = faces.partition_point(|other| other.0 < *face);
        assert_eq!(faces[at].0, *face);
        assert!(faces.get(at + 1).is_none_or(|next| next.0 != *face));
    }
}

/// True where the face lies in a face of a root cube that has the domain on one side only.
fn on_hull(f: &BisectionForest, face: &[[i32; 3]; 3]) -> bool {
    let lattice = f.domain().lattice();
    let inside: Vec<usize> = f.domain().cells().collect();
    (0..3).any(|axis| {
        let plane = face[0][axis];
        let flat = face.iter().all(|p| p[axis] == plane) && plane % lattice.units == 0;
        let centre: [i32; 3] = std::array::from_fn(|i| face.iter().map(|p| p[i]).sum::<i32>());
        let around = [-1, 1].map(|step| {
            // Three times the centroid, moved off the plane to either side.
            let mut cell = centre;
            cell[axis] += step;
            let cell = cell.map(|c| c.div_euclid(3 * lattice.units));
            let valid = (0..3).all(|i| cell[i] >= 0 && (cell[i] as usize) < lattice.cells[i]);
            valid && {
                let c = cell.map(|c| c as usize);
                inside.contains(&(c[0] + lattice.cells[0] * (c[1] + lattice.cells[1] * c[2])))
            }
        });
        flat && around[0] != around[1]
    })
}

fn assert_good_shapes(f: &BisectionForest) {
    let placement = Placement { origin: Vector3::zeros(), unit: 1.0 };
    for tet in f.leaves() {
        let quality = Quality::of(&tet.vertices.map(|v| placement.position(f.point(v))));
        assert!(quality.radius_ratio >= 0.6407, "{quality:?}");
        assert!(quality.circumradius_over_shortest_edge <= 1.1181, "{quality:?}");
    }
}

/// All that a mesh is, in an order that does not depend on history.
fn snapshot(f: &BisectionForest) -> Vec<([[i32; 3]; 4], u8)> {
    let mut leaves: Vec<_> =
        f.leaves().map(|t| (t.vertices.map(|v| f.point(v)), t.level)).collect();
    leaves.sort_unstable();
    leaves
}

#[derive(Clone, Debug)]
enum Step {
    Split(Index),
    Merge(Index),
}

fn steps(count: usize) -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        3 => any::<Index>().prop_map(Step::Split),
        2 => any::<Index>().prop_map(Step::Merge),
    ];
    proptest::collection::vec(step, count)
}

fn walk(f: &mut BisectionForest, steps: &[Step], check_every: usize) {
    let mut delta = MeshDelta::empty();
    let mut vertices: Vec<VertexId> = f.vertices().collect();
    for (count, step) in steps.iter().enumerate() {
        match step {
            Step::Split(index) => {
                let leaves: Vec<_> = f.leaves().filter_map(|t| f.refinement_point(t.id)).collect();
                if leaves.is_empty() {
                    continue;
                }
                let p = leaves[index.index(leaves.len())];
                let mut added = Vec::new();
                f.split_with_closure(p, &mut delta, |_, d| added.push(d.vertex)).unwrap();
                vertices.extend(added);
            }
            Step::Merge(index) => {
                let v = vertices[index.index(vertices.len())];
                let allowed = f.is_mergeable(v);
                assert_eq!(f.merge(v, &mut delta).is_ok(), allowed);
                if allowed {
                    vertices.retain(|&w| w != v);
                }
            }
        }
        if (count + 1) % check_every == 0 {
            assert_conforming(f);
            assert_good_shapes(f);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2, ..ProptestConfig::default() })]

    #[test]
    fn ten_thousand_steps_on_a_box(steps in steps(10_000)) {
        let mut f = forest([2, 2, 2], &[], 0, 9);
        let before = snapshot(&f);
        walk(&mut f, &steps, 2_500);
        f.merge_all().unwrap();
        prop_assert_eq!(snapshot(&f), before);
        prop_assert_eq!(f.vertex_count(), 27);
    }

    #[test]
    fn ten_thousand_steps_on_a_voxel_shape(steps in steps(10_000)) {
        // Cells 1 and 6 gone: re-entrant edges, and cells that touch in an edge only.
        let mut f = forest([3, 2, 2], &[1, 6, 9], 2, 8);
        let before = snapshot(&f);
        walk(&mut f, &steps, 2_500);
        f.merge_all().unwrap();
        prop_assert_eq!(snapshot(&f), before);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn any_order_of_splits_gives_the_same_mesh(
        picks in proptest::collection::vec(any::<Index>(), 40),
        swaps in proptest::collection::vec((any::<Index>(), any::<Index>()), 60),
    ) {
        let mut delta = MeshDelta::empty();
        let mut one = forest([2, 1, 2], &[], 0, 6);
        let mut points = Vec::new();
        for pick in picks {
            let all = one.candidates();
            if all.is_empty() { break; }
            let p = all[pick.index(all.len())];
            one.split(p, &mut delta).unwrap();
            points.push(p);
        }
        for (a, b) in swaps {
            let n = points.len();
            points.swap(a.index(n), b.index(n));
        }
        let mut other = forest([2, 1, 2], &[], 0, 6);
        for p in points {
            if other.vertex_at(p).is_none() {
                other.split_with_closure(p, &mut delta, |_, _| ()).unwrap();
            }
        }
        prop_assert_eq!(snapshot(&one), snapshot(&other));
    }

    #[test]
    fn a_merge_undoes_a_split_bit_by_bit(picks in proptest::collection::vec(any::<Index>(), 30)) {
        let mut delta = MeshDelta::empty();
        let mut back = MeshDelta::empty();
        let mut f = forest([2, 2, 1], &[], 0, 7);
        for pick in picks {
            let all = f.candidates();
            let p = all[pick.index(all.len())];
            let before = snapshot(&f);
            let v = f.split(p, &mut delta).unwrap();
            f.merge(v, &mut back).unwrap();
            prop_assert_eq!(snapshot(&f), before);
            prop_assert_eq!(&delta.ring, &back.ring);
            prop_assert_eq!(delta.edge, back.edge);
            f.split(p, &mut delta).unwrap();
        }
    }
}
