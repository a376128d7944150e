//! Counts, shapes and checksums against an independent prototype in exact integer arithmetic.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use yawara_mesh::kuhn::{bisect, midpoint, root_corners, signed_volume6};
use yawara_mesh::lattice::{Lattice, Site};
use yawara_mesh::{BisectionForest, Domain, LabelTree, MeshDelta, Placement, Point, Quality, Tet};

fn forest(cells: usize, start_level: u8, max_level: u8) -> BisectionForest {
    let cells = [cells; 3];
    let domain = Domain::full(Lattice::new(cells, max_level));
    let tree = Arc::new(LabelTree::homogeneous(cells, 1));
    BisectionForest::new(domain, tree, start_level, max_level).unwrap()
}

/// Sum over active vertices of (x+1)(y+3)(z+7)(generation+1) mod 2⁶⁴.
fn checksum(forest: &BisectionForest) -> u64 {
    forest
        .vertices()
        .map(|v| {
            let [x, y, z] = forest.point(v).map(|c| c as u64);
            (x + 1) * (y + 3) * (z + 7) * (u64::from(forest.generation(v)) + 1)
        })
        .fold(0, u64::wrapping_add)
}

fn leaf_levels(forest: &BisectionForest) -> BTreeMap<u8, usize> {
    let mut levels = BTreeMap::new();
    for tet in forest.leaves() {
        *levels.entry(tet.level).or_insert(0) += 1;
    }
    levels
}

#[test]
fn uniform_levels_have_the_known_counts() {
    let one = [
        (8, 6, 12),
        (9, 12, 12),
        (15, 24, 24),
        (27, 48, 48),
        (35, 96, 48),
        (71, 192, 96),
        (125, 384, 192),
        (189, 768, 192),
        (429, 1536, 384),
        (729, 3072, 768),
    ];
    let two = [
        (27, 48, 48),
        (35, 96, 48),
        (71, 192, 96),
        (125, 384, 192),
        (189, 768, 192),
        (429, 1536, 384),
        (729, 3072, 768),
        (1241, 6144, 768),
        (2969, 12288, 1536),
        (4913, 24576, 3072),
    ];
    let three = [
        (64, 162, 108),
        (91, 324, 108),
        (199, 648, 216),
        (343, 1296, 432),
        (559, 2592, 432),
        (1315, 5184, 864),
        (2197, 10368, 1728),
    ];
    for (cells, rows) in [(1, &one[..]), (2, &two[..]), (3, &three[..])] {
        for (level, &(vertices, leaves, boundary)) in rows.iter().enumerate() {
            let f = forest(cells, level as u8, level as u8);
            let got = (f.vertex_count(), f.leaf_count(), f.boundary_faces().len());
            assert_eq!(got, (vertices, leaves, boundary), "{cells} cells, level {level}");
            assert_eq!((f.vertices().count(), f.leaves().count()), (vertices, leaves));
        }
    }
}

#[test]
fn shapes_have_the_known_measures() {
    let placement = Placement { origin: Vector3::zeros(), unit: 0.5 };
    let mut corners = root_corners([0, 0, 0], 0, 2);
    let mut worst = Vec::new();
    // V, circumradius / shortest edge, 3 r / R of TYPE0, TYPE1, TYPE2 for a unit cube.
    let expected = [
        (0.16666666666666666, 0.8660254037844386, 0.7174389352143009),
        (0.08333333333333333, 0.8660254037844387, 0.6407544820340815),
        (0.041666666666666664, 1.118033988749895, 0.7008835444863375),
    ];
    for (level, (volume, over_shortest, radius_ratio)) in expected.into_iter().enumerate() {
        let quality = Quality::of(&corners.map(|p| placement.position(p)));
        let v = signed_volume6(&corners).abs() as f64 / 48.0;
        assert!((v - volume).abs() < 1e-15, "level {level}: {v}");
        assert!((quality.circumradius_over_shortest_edge - over_shortest).abs() < 1e-14);
        assert!((quality.radius_ratio - radius_ratio).abs() < 1e-14);
        worst.push(quality);
        corners = bisect(&corners, level as u8, midpoint(&corners, level as u8))[0];
    }
    let all = worst[0].worse(worst[1]).worse(worst[2]);
    assert!((all.radius_ratio - 4.0 / (2.0 + 3.0 * 2f64.sqrt())).abs() < 1e-14);
    assert!((all.circumradius_over_shortest_edge - 5f64.sqrt() / 2.0).abs() < 1e-14);
}

#[test]
fn interior_rings_have_the_known_sizes() {
    let f = forest(4, 3, 9);
    let mut mesh = f.clone();
    let mut delta = MeshDelta::empty();
    // Tetrahedra, old vertices, dependencies of the three kinds away from the boundary.
    for (site, tets, old, deps) in
        [(Site::CubeCentre, 6, 8, 3), (Site::FaceCentre, 4, 6, 2), (Site::EdgeMidpoint, 8, 10, 4)]
    {
        let lattice = *mesh.domain().lattice();
        let inner = |p: Point| p.iter().all(|&c| c > lattice.units && c < 3 * lattice.units);
        let points: Vec<Point> = mesh.candidates();
        let kind = |p: Point| lattice.site(p).0;
        let mut seen = 0;
        for p in points.into_iter().filter(|&p| kind(p) == site) {
            mesh.split(p, &mut delta).unwrap();
            if !inner(p) {
                continue;
            }
            let mut vertices: Vec<_> = delta.ring.iter().flat_map(|t| t.parent.vertices).collect();
            vertices.sort();
            vertices.dedup();
            assert_eq!((delta.ring.len(), vertices.len()), (tets, old));
            // The ring without the edge's ends, and the younger vertices that need this one.
            assert_eq!(vertices.len() - delta.edge.len(), tets);
            assert_eq!(dependents(&lattice, p), tets);
            assert_eq!(lattice.dependencies(p).as_slice().len(), deps);
            seen += 1;
        }
        assert!(seen > 0, "{site:?}");
    }
}

/// How many lattice points around `p` depend on it.
fn dependents(lattice: &Lattice, p: Point) -> usize {
    let near = |i: usize| p[i] - lattice.units..=p[i] + lattice.units;
    let around = near(0).flat_map(|x| near(1).flat_map(move |y| near(2).map(move |z| [x, y, z])));
    around
        .filter(|&q| lattice.contains(q) && lattice.dependencies(q).as_slice().contains(&p))
        .count()
}

/// True where the point x/denominator lies in the closed tetrahedron.
fn contains(f: &BisectionForest, tet: &Tet, x: Point, denominator: i32) -> bool {
    let corners = tet.vertices.map(|v| f.point(v).map(|c| c * denominator));
    let whole = signed_volume6(&corners);
    (0..4).all(|i| {
        let mut part = corners;
        part[i] = x;
        signed_volume6(&part) * whole.signum() >= 0
    })
}

/// Length of the longest chain of missing older vertices below `p`.
fn depth(f: &BisectionForest, p: Point) -> usize {
    let lattice = f.domain().lattice();
    let dependencies = lattice.dependencies(p);
    let missing = dependencies.as_slice().iter().filter(|&&q| f.vertex_at(q).is_none());
    missing.map(|&q| depth(f, q) + 1).max().unwrap_or(0)
}

#[test]
fn zoom_to_a_point_adds_the_known_closures() {
    let mut f = forest(2, 0, 9);
    let (target, denominator) = ([851, 552, 1103], 100);
    let (mut closures, mut depths) = (Vec::new(), Vec::new());
    let mut delta = MeshDelta::empty();
    loop {
        let tet = f.leaves().find(|t| contains(&f, t, target, denominator)).unwrap();
        if tet.level == 9 {
            break;
        }
        let p = f.refinement_point(tet.id).unwrap();
        depths.push(depth(&f, p));
        let before = f.vertex_count();
        f.split_with_closure(p, &mut delta, |_, _| ()).unwrap();
        closures.push(f.vertex_count() - before);
    }
    assert_eq!(closures, [1, 2, 6, 11, 6, 13, 19, 15, 15]);
    assert_eq!(depths, [0, 1, 2, 3, 4, 4, 5, 6, 6]);
    assert_eq!((f.vertex_count(), f.leaf_count(), f.boundary_faces().len()), (115, 480, 82));
    let levels = [(1, 32), (2, 56), (3, 72), (4, 72), (5, 88), (6, 88), (7, 32), (8, 24), (9, 16)];
    assert_eq!(leaf_levels(&f), BTreeMap::from(levels));
    assert_eq!(checksum(&f), 670_950);
}

#[test]
fn sphere_refines_to_the_known_mesh() {
    let mut f = forest(2, 0, 9);
    let (centre3, radius) = (3 * 8 + 1, 9 * 8 / 4);
    let outside =
        |p: Point| p.iter().map(|&c| (3 * c - centre3).pow(2)).sum::<i32>() >= radius * radius;
    let straddles = |f: &BisectionForest, tet: &Tet| {
        let sides = tet.vertices.map(|v| outside(f.point(v)));
        sides.contains(&true) && sides.contains(&false)
    };
    let mut delta = MeshDelta::empty();
    loop {
        let wanted: Vec<Point> = f
            .leaves()
            .filter(|t| t.level < 9 && straddles(&f, t))
            .filter_map(|t| f.refinement_point(t.id))
            .collect();
        if wanted.is_empty() {
            break;
        }
        for p in wanted {
            if f.vertex_at(p).is_none() {
                f.split_with_closure(p, &mut delta, |_, _| ()).unwrap();
            }
        }
    }
    let straddling = f.leaves().filter(|t| straddles(&f, t)).count();
    assert_eq!(straddling, 3138);
    assert_eq!((f.vertex_count(), f.leaf_count(), f.boundary_faces().len()), (1916, 10032, 504));
    let levels = [(4, 48), (5, 264), (6, 576), (7, 936), (8, 2256), (9, 5952)];
    assert_eq!(leaf_levels(&f), BTreeMap::from(levels));
    assert_eq!(checksum(&f), 24_124_912);
}
