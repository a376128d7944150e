//! Refinement leaves no cracks.

use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::isosurface::IsoSurface;
use yawara_mesh::{BisectionForest, MeshDelta, VertexId};

use crate::checks::{
    CENTRE, CLOSED, OPEN, assert_closed, assert_valid, edge_counts, forest, positions, sample,
};

/// Splits the leaves, once each, of which `wanted` holds at a corner.
pub fn split_where(f: &mut BisectionForest, wanted: impl Fn([i32; 3]) -> bool) {
    let points: Vec<_> = f
        .leaves()
        .filter(|tet| tet.vertices.iter().any(|&v| wanted(f.point(v))))
        .filter_map(|tet| f.refinement_point(tet.id))
        .collect();
    let mut delta = MeshDelta::empty();
    for p in points {
        if f.vertex_at(p).is_none() {
            f.split_with_closure(p, &mut delta, |_, _| ()).unwrap();
        }
    }
}

#[test]
fn leaves_of_two_levels_share_surface_vertices() {
    // The two halves of a mesh, marched on their own: where they meet they must agree bit by bit.
    let mut f = forest([2, 2, 2], &[], 5, 9);
    let middle = f.domain().lattice().units;
    split_where(&mut f, |p| p[0] < middle);
    let field = sample(&f, |x| 0.83 - (x - Vector3::from(CENTRE)).norm_squared().sqrt());
    let x = positions(&f);
    let part = |fine: bool| {
        let tets: Vec<[VertexId; 4]> =
            f.leaves().filter(|t| (t.level > 5) == fine).map(|t| t.vertices).collect();
        IsoSurface::of_tets(&tets, &x, &field, OPEN).unwrap()
    };
    let (coarse, fine) = (part(false), part(true));
    let whole = IsoSurface::of_forest(&f, &field, OPEN).unwrap();
    let shared: Vec<_> =
        coarse.vertices.iter().filter(|v| fine.vertices.iter().any(|w| w.edge == v.edge)).collect();
    assert!(shared.len() > 10);
    for v in shared {
        assert!(fine.vertices.contains(v) && whole.vertices.contains(v));
    }
    assert_eq!(coarse.triangles.len() + fine.triangles.len(), whole.triangles.len());
    assert!(edge_counts(&coarse).values().any(|&c| c.1 == 1));
    assert_closed(&whole);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn no_refinement_and_no_field_cracks_the_surface(
        picks in proptest::collection::vec(any::<Index>(), 0..60),
        // Few values, so that many vertices lie exactly on the level.
        values in proptest::collection::vec(-2i8..=2, 512),
        voxel_shaped in any::<bool>(),
    ) {
        let cut_out: &[usize] = if voxel_shaped { &[1, 6, 9] } else { &[] };
        let mut f = forest([3, 2, 2], cut_out, 0, 9);
        let mut delta = MeshDelta::empty();
        for pick in picks {
            let leaves: Vec<_> = f.leaves().filter_map(|t| f.refinement_point(t.id)).collect();
            if leaves.is_empty() { break; }
            let p = leaves[pick.index(leaves.len())];
            f.split_with_closure(p, &mut delta, |_, _| ()).unwrap();
        }
        let field: Vec<f64> =
            (0..f.vertex_capacity()).map(|i| f64::from(values[i % values.len()])).collect();
        let surface = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
        let points = surface.positions(&positions(&f)).unwrap();
        assert_valid(&surface, &points);
        for (edge, (balance, count)) in edge_counts(&surface) {
            prop_assert_eq!(balance, 0, "edge {:?}", edge);
            // Cells that touch in an edge only have four hull faces there.
            prop_assert!(count == 2 || (voxel_shaped && count == 4), "edge {:?}: {}", edge, count);
        }
        // Open surfaces end on the hull only.
        let open = IsoSurface::of_forest(&f, &field, OPEN).unwrap();
        let hull: Vec<VertexId> = f.boundary_faces().into_iter().flatten().collect();
        for ([a, b], (_, count)) in edge_counts(&open) {
            if count == 1 {
                for v in [a, b] {
                    prop_assert!(open.vertices[v as usize].edge.iter().all(|v| hull.contains(v)));
                }
            } else {
                prop_assert_eq!(count, 2);
            }
        }
        if !surface.triangles.is_empty() {
            prop_assert!(surface.volume(&points).unwrap() > 0.0);
        }
    }
}
