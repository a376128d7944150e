//! Iso-surfaces are closed, oriented and converge; refinement leaves no cracks in them.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::isosurface::{EDGE_MARGIN, IsoSurface, LabelField, SurfaceOptions};
use yawara_mesh::phantom::block;
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{
    BisectionForest, CellGrid, Domain, LabelTree, Lattice, MeshDelta, MeshError, Region, VertexId,
};

const OPEN: SurfaceOptions = SurfaceOptions { level: 0.0, close_at_hull: false, label: 1 };
const CLOSED: SurfaceOptions = SurfaceOptions { close_at_hull: true, ..OPEN };

fn forest(cells: [usize; 3], cut_out: &[usize], start: u8, max: u8) -> BisectionForest {
    let mut domain = Domain::full(Lattice::new(cells, max));
    domain.exclude(cut_out);
    BisectionForest::new(domain, Arc::new(LabelTree::homogeneous(cells, 1)), start, max).unwrap()
}

/// Positions in root cubes, by vertex number.
fn positions(f: &BisectionForest) -> Vec<Vector3<f64>> {
    let unit = f64::from(f.domain().lattice().units);
    let mut x = vec![Vector3::zeros(); f.vertex_capacity()];
    for v in f.vertices() {
        x[v.index()] = Vector3::from(f.point(v).map(|c| f64::from(c) / unit));
    }
    x
}

/// How often each directed edge is passed, less how often the other way; and how often at all.
fn edge_counts(surface: &IsoSurface) -> BTreeMap<[u32; 2], (i32, i32)> {
    let mut counts = BTreeMap::new();
    for &[a, b, c] in &surface.triangles {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            let count: &mut (i32, i32) = counts.entry([a.min(b), a.max(b)]).or_default();
            count.0 += if a < b { 1 } else { -1 };
            count.1 += 1;
        }
    }
    counts
}

/// Every edge belongs to two triangles that pass it in opposite directions.
fn assert_closed(surface: &IsoSurface) {
    for (edge, count) in edge_counts(surface) {
        assert_eq!(count, (0, 2), "edge {edge:?}");
    }
}

fn assert_valid(surface: &IsoSurface, points: &[Vector3<f64>]) {
    assert!(surface.vertices.is_sorted_by(|v, w| v.edge < w.edge));
    let mut used = vec![false; surface.vertices.len()];
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|i| points[i as usize]);
        assert!((b - a).cross(&(c - a)).norm() > 0.0, "flat {triangle:?}");
        for &i in triangle {
            used[i as usize] = true;
        }
    }
    assert!(used.iter().all(|&used| used));
    for v in &surface.vertices {
        let on_edge = v.edge[0] < v.edge[1] && (EDGE_MARGIN..=1.0 - EDGE_MARGIN).contains(&v.t);
        assert!(on_edge || (v.edge[0] == v.edge[1] && v.t == 0.0), "{v:?}");
    }
}

fn sample(f: &BisectionForest, field: impl Fn(Vector3<f64>) -> f64) -> Vec<f64> {
    positions(f).into_iter().map(field).collect()
}

/// Off every symmetry plane of the lattice.
const CENTRE: [f64; 3] = [1.017, 0.988, 1.009];

/// Slope of the least-squares line through (ln h, ln error).
fn slope(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let logs: Vec<(f64, f64)> = pairs.iter().map(|(h, e)| (h.ln(), e.ln())).collect();
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    mean(&|p| (p.0 - mx) * (p.1 - my)) / mean(&|p| (p.0 - mx).powi(2))
}

#[test]
fn sphere_is_closed_and_converges_with_second_order() {
    let r = 0.83;
    // A linear surface on shape-regular tetrahedra: places off by O(h²), normals by O(h), and
    // the area by the square of the normals' error.
    type Field = fn(Vector3<f64>) -> f64;
    let fields: [(&str, Field); 2] = [
        ("distance", |x| 0.83 - (x - Vector3::from(CENTRE)).norm()),
        ("square", |x| 0.83 * 0.83 - (x - Vector3::from(CENTRE)).norm_squared()),
    ];
    for (name, field) in fields {
        let (mut volumes, mut areas) = (Vec::new(), Vec::new());
        for level in [6, 9, 12, 15] {
            let f = forest([2, 2, 2], &[], level, level);
            let surface = IsoSurface::of_forest(&f, &sample(&f, field), OPEN).unwrap();
            let points = surface.positions(&positions(&f)).unwrap();
            assert_closed(&surface);
            assert_valid(&surface, &points);
            assert_eq!((surface.euler_characteristic(), surface.component_count()), (2, 1));
            let h = 0.5f64.powi(i32::from(level) / 3);
            let volume = 4.0 / 3.0 * std::f64::consts::PI * r * r * r;
            let area = 4.0 * std::f64::consts::PI * r * r;
            volumes.push((h, (surface.volume(&points).unwrap() / volume - 1.0).abs()));
            areas.push((h, (surface.area(&points).unwrap() / area - 1.0).abs()));
        }
        assert!(slope(&volumes) > 1.8, "{name}: {volumes:?}");
        assert!(slope(&areas) > 1.8, "{name}: {areas:?}");
    }
}

#[test]
fn torus_has_euler_characteristic_zero() {
    let f = forest([2, 2, 2], &[], 12, 12);
    let field = sample(&f, |x| {
        let x = x - Vector3::from(CENTRE);
        0.3 - ((x.x.hypot(x.y) - 0.6).powi(2) + x.z * x.z).sqrt()
    });
    let surface = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
    let points = surface.positions(&positions(&f)).unwrap();
    assert_closed(&surface);
    assert_valid(&surface, &points);
    assert_eq!((surface.euler_characteristic(), surface.component_count()), (0, 1));
    assert_eq!(surface.level_triangles, surface.triangles.len(), "away from the hull");
    // Pappus: 2π²Rr².
    let volume = 2.0 * std::f64::consts::PI.powi(2) * 0.6 * 0.09;
    assert!((surface.volume(&points).unwrap() / volume - 1.0).abs() < 0.02);
}

#[test]
fn vertices_exactly_on_the_level_leave_no_flat_triangle() {
    // A plane, an octahedron and a constant, all of them through lattice points.
    let f = forest([2, 2, 2], &[], 6, 6);
    let fields: [fn(Vector3<f64>) -> f64; 3] =
        [|x| 1.0 - x.z, |x| 0.5 - (x - Vector3::repeat(1.0)).abs().sum(), |_| 0.0];
    let volumes = [4.0, 4.0 / 3.0 * 0.125, 8.0];
    for (field, volume) in fields.into_iter().zip(volumes) {
        let surface = IsoSurface::of_forest(&f, &sample(&f, field), CLOSED).unwrap();
        let points = surface.positions(&positions(&f)).unwrap();
        assert_closed(&surface);
        assert_valid(&surface, &points);
        // The margin moves the surface outwards by at most ε edges, of √3/4 at this level.
        let moved = surface.volume(&points).unwrap() - volume;
        let most = EDGE_MARGIN * 3f64.sqrt() / 4.0 * surface.area(&points).unwrap();
        assert!((-1e-12..=most + 1e-12).contains(&moved), "{moved} of {most}");
    }
}

#[test]
fn a_label_at_the_hull_is_closed_on_request() {
    // A ball around a corner of the box, and one around the middle of a face.
    for (centre, part) in [([0.0, 0.0, 0.0], 0.125), ([1.0, 1.0, 0.0], 0.5)] {
        let f = forest([2, 2, 2], &[], 12, 12);
        let field = sample(&f, |x| 0.83 - (x - Vector3::from(centre)).norm());
        let open = IsoSurface::of_forest(&f, &field, OPEN).unwrap();
        let closed = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
        assert!(edge_counts(&open).values().any(|&c| c.1 == 1), "open at the hull");
        let points = closed.positions(&positions(&f)).unwrap();
        assert_closed(&closed);
        assert_valid(&closed, &points);
        assert_eq!(closed.euler_characteristic(), 2);
        assert_eq!(closed.level_triangles, open.triangles.len());
        let volume = part * 4.0 / 3.0 * std::f64::consts::PI * 0.83f64.powi(3);
        assert!((closed.volume(&points).unwrap() / volume - 1.0).abs() < 0.01);
    }
}

#[test]
fn the_whole_body_has_its_hull_as_surface() {
    // Cell 1 of eight is cut out: re-entrant edges, but no edge where cells only touch.
    let f = forest([2, 2, 2], &[1], 3, 3);
    let surface = IsoSurface::of_forest(&f, &sample(&f, |_| 1.0), CLOSED).unwrap();
    let points = surface.positions(&positions(&f)).unwrap();
    assert_closed(&surface);
    assert_eq!((surface.level_triangles, surface.euler_characteristic()), (0, 2));
    assert!((surface.volume(&points).unwrap() - 7.0).abs() < 1e-13);
    assert!((surface.area(&points).unwrap() - 24.0).abs() < 1e-13);
}

#[test]
fn the_surface_moves_with_the_mesh() {
    let mut f = forest([2, 2, 2], &[], 6, 9);
    let low = f.domain().lattice().units;
    f.refine_to_labels(9, usize::MAX, Region::Everywhere).unwrap();
    split_where(&mut f, |p| p[0] < low);
    let field = sample(&f, |x| 0.83 - (x - Vector3::from(CENTRE)).norm());
    let surface = IsoSurface::of_forest(&f, &field, OPEN).unwrap();
    let a = Matrix3::new(1.2, 0.3, -0.1, 0.2, 0.7, 0.4, -0.3, 0.1, 1.6);
    let b = Vector3::new(3.0, -2.0, 5.0);
    let x = positions(&f);
    let moved: Vec<Vector3<f64>> = x.iter().map(|x| a * x + b).collect();
    let (rest, deformed) = (surface.positions(&x).unwrap(), surface.positions(&moved).unwrap());
    // Two roundings each of map and interpolation, on values below 10.
    for (rest, deformed) in rest.iter().zip(&deformed) {
        assert!((a * rest + b - deformed).norm() < 10.0 * 10.0 * f64::EPSILON);
    }
    let ratio = surface.volume(&deformed).unwrap() / surface.volume(&rest).unwrap();
    assert!((ratio / a.determinant() - 1.0).abs() < 1e-12);
}

/// Splits the leaves, once each, of which `wanted` holds at a corner.
fn split_where(f: &mut BisectionForest, wanted: impl Fn([i32; 3]) -> bool) {
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

#[test]
fn a_list_of_tetrahedra_may_be_turned_either_way() {
    let f = forest([2, 2, 2], &[], 6, 6);
    let field = sample(&f, |x| 0.83 - (x - Vector3::from(CENTRE)).norm());
    let x = positions(&f);
    let mut tets: Vec<[VertexId; 4]> = f.leaves().map(|tet| tet.vertices).collect();
    let expected = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
    assert_eq!(IsoSurface::of_tets(&tets, &x, &field, CLOSED).unwrap(), expected);
    for tet in tets.iter_mut().step_by(3) {
        tet.swap(1, 3);
    }
    let surface = IsoSurface::of_tets(&tets, &x, &field, CLOSED).unwrap();
    assert_eq!(surface.vertices, expected.vertices);
    assert_closed(&surface);
    let volume = |s: &IsoSurface| s.volume(&s.positions(&x).unwrap()).unwrap();
    assert!((volume(&surface) - volume(&expected)).abs() < 1e-12);
}

#[test]
fn bad_input_is_refused() {
    let f = forest([1, 1, 1], &[], 0, 3);
    let field = vec![1.0; f.vertex_capacity()];
    let x = positions(&f);
    let tets: Vec<[VertexId; 4]> = f.leaves().map(|tet| tet.vertices).collect();
    let nan = SurfaceOptions { level: f64::NAN, ..OPEN };
    let error = IsoSurface::of_forest(&f, &field, nan).unwrap_err();
    assert!(matches!(error, MeshError::IsoSurface { field: "level", .. }), "{error}");
    let error = IsoSurface::of_forest(&f, &field[1..], OPEN).unwrap_err();
    assert!(matches!(error, MeshError::EntryCount { found: 7, want: 8, .. }), "{error}");
    let error = IsoSurface::of_tets(&tets, &x[..7], &field, OPEN).unwrap_err();
    assert!(matches!(error, MeshError::EntryCount { what: "positions", .. }), "{error}");
    for value in [f64::NAN, f64::INFINITY] {
        let mut bad = field.clone();
        bad[3] = value;
        for error in [
            IsoSurface::of_forest(&f, &bad, OPEN).unwrap_err(),
            IsoSurface::of_tets(&tets, &x, &bad, OPEN).unwrap_err(),
        ] {
            assert!(matches!(error, MeshError::EntryNotFinite { index: 3, .. }), "{error}");
        }
        let mut bad = x.clone();
        bad[2].y = value;
        let error = IsoSurface::of_tets(&tets, &bad, &field, OPEN).unwrap_err();
        assert!(matches!(error, MeshError::EntryNotFinite { index: 2, .. }), "{error}");
        let surface = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
        assert!(matches!(surface.positions(&bad), Err(MeshError::EntryNotFinite { index: 2, .. })));
        assert!(matches!(surface.volume(&x[1..]), Err(MeshError::EntryCount { .. })));
    }
    let flat = [[0, 1, 2, 2].map(VertexId)];
    let error = IsoSurface::of_tets(&flat, &x, &field, OPEN).unwrap_err();
    assert!(matches!(error, MeshError::FlatTet { tet: 0, .. }), "{error}");
    // Differences of extreme values overflow; the surface must not.
    let huge: Vec<f64> =
        (0..f.vertex_capacity()).map(|i| if i % 2 == 0 { f64::MAX } else { f64::MIN }).collect();
    let surface = IsoSurface::of_forest(&f, &huge, CLOSED).unwrap();
    assert!(surface.vertices.iter().all(|v| v.t == 0.5 || v.edge[0] == v.edge[1]));
    assert_closed(&surface);
}

/// A ball of label 1 with a core of label 2, in void, in a volume of n³ voxels.
fn ball(n: usize) -> LabelVolume {
    let middle = n as f64 / 2.0;
    let labels = (0..n.pow(3)).map(|i| {
        let v = [i % n, i / n % n, i / (n * n)].map(|c| c as f64 + 0.5 - middle);
        let r = Vector3::from(v).norm() / middle;
        if r < 0.4 { 2 } else { u16::from(r < 0.8) }
    });
    LabelVolume::new(Grid::centred([n; 3], 1.0), labels.collect(), vec![0, 1, 2]).unwrap()
}

fn label_forest(volume: &LabelVolume, voxels_per_cell: usize) -> BisectionForest {
    let grid = CellGrid::around(volume, voxels_per_cell).unwrap();
    let tree = LabelTree::new(volume, grid).unwrap();
    let domain = Domain::of_labels(Lattice::new(grid.cells, grid.embed_level()), &tree);
    BisectionForest::new(domain, Arc::new(tree), 0, grid.embed_level()).unwrap()
}

#[test]
fn labels_become_smooth_nested_surfaces() {
    let volume = ball(64);
    let mut f = label_forest(&volume, 8);
    f.refine_to_labels(9, usize::MAX, Region::Everywhere).unwrap();
    // Positions in voxels.
    let x: Vec<Vector3<f64>> = positions(&f).into_iter().map(|x| 8.0 * x).collect();
    // Label 1 is a shell (two spheres), label 2 its core.
    for (label, spheres) in [(1, 2), (2, 1)] {
        let field = LabelField::blurred(&volume, label, 1.0).unwrap().on_vertices(&f);
        let surface = IsoSurface::of_forest(&f, &field, SurfaceOptions::of_label(label)).unwrap();
        let points = surface.positions(&x).unwrap();
        assert_closed(&surface);
        assert_valid(&surface, &points);
        let counts = (surface.component_count(), surface.euler_characteristic());
        assert_eq!((counts, surface.label), ((spheres, 2 * spheres as i64), label));
        // A blur of variance σ² moves a sphere of r voxels by σ²/r: a volume of 4πrσ². Linear
        // values between the centres add 1/6 to σ² on average; chords cost less than 1 %.
        let voxels = volume.counts()[usize::from(label)] as f64;
        let radii: &[f64] = if label == 1 { &[25.6, -12.8] } else { &[12.8] };
        let lost: f64 =
            radii.iter().map(|r| 4.0 * std::f64::consts::PI * r * (1.0 + 1.0 / 6.0)).sum();
        let found = surface.volume(&points).unwrap();
        assert!((found - (voxels - lost)).abs() < 0.01 * voxels, "{found}, {voxels} - {lost}");
    }
}

#[test]
fn a_block_that_fills_its_volume_is_closed() {
    let volume = block([16, 16, 16], 1.0).unwrap();
    let mut f = label_forest(&volume, 8);
    f.refine_uniformly(6).unwrap();
    let field = LabelField::blurred(&volume, 1, 1.0).unwrap().on_vertices(&f);
    let surface = IsoSurface::of_forest(&f, &field, SurfaceOptions::of_label(1)).unwrap();
    assert_closed(&surface);
    assert_eq!(surface.euler_characteristic(), 2);
}

/// Leaves that have several labels, by level.
fn mixed_levels(f: &BisectionForest) -> Vec<u8> {
    let several = |tet: &yawara_mesh::Tet| f.tree().labels(tet.node).as_slice().len() > 1;
    f.leaves().filter(several).map(|tet| tet.level).collect()
}

#[test]
fn refinement_ends_where_each_leaf_has_one_label() {
    let volume = ball(16);
    let mut f = label_forest(&volume, 8);
    let before = f.vertex_count();
    let done = f.refine_to_labels(5, usize::MAX, Region::Everywhere).unwrap();
    assert_eq!((f.vertex_count() - before, done.left), (done.added, 0));
    assert!(!mixed_levels(&f).is_empty() && mixed_levels(&f).iter().all(|&level| level >= 5));
    let done = f.refine_to_labels(9, usize::MAX, Region::Everywhere).unwrap();
    assert_eq!(done.left, 0);
    assert!(mixed_levels(&f).is_empty(), "one cube is one voxel at level 9");
    // Far coarser than the uniform mesh inside of the labels.
    assert!(f.leaves().any(|tet| tet.level <= 5));
    assert!(f.refine_to_labels(10, usize::MAX, Region::Everywhere).is_err());
}

#[test]
fn refinement_keeps_to_its_limits() {
    let volume = ball(16);
    let fresh = || label_forest(&volume, 8);
    for limit in [0, 100, 350] {
        let mut f = fresh();
        let before = f.vertex_count();
        let done = f.refine_to_labels(9, limit, Region::Everywhere).unwrap();
        assert!(f.vertex_count() <= limit.max(before) && done.left > 0);
        // Largest first: nothing is left two levels above what was split.
        let finest = f.leaves().map(|tet| tet.level).max().unwrap();
        assert!(mixed_levels(&f).iter().all(|&level| level + 2 >= finest));
    }
    let units = fresh().domain().lattice().units;
    let inside = |p: [i32; 3]| p.iter().all(|&c| c <= units / 4);
    let corner = Region::Box([0; 3], [units / 4; 3]);
    for region in [corner, Region::Where(&inside)] {
        let mut f = fresh();
        let done = f.refine_to_labels(9, usize::MAX, region).unwrap();
        assert_eq!(done.left, 0);
        let mut all = fresh();
        all.refine_to_labels(9, usize::MAX, Region::Everywhere).unwrap();
        assert!(f.vertex_count() > fresh().vertex_count());
        assert!(f.vertex_count() < all.vertex_count() / 2);
    }
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
