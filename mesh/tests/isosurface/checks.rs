//! What every surface must be, and the meshes and fields to try it on.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use yawara_mesh::isosurface::{EDGE_MARGIN, IsoSurface, SurfaceOptions};
use yawara_mesh::{BisectionForest, Domain, LabelTree, Lattice};

pub const OPEN: SurfaceOptions = SurfaceOptions { level: 0.0, close_at_hull: false, label: 1 };
pub const CLOSED: SurfaceOptions = SurfaceOptions { close_at_hull: true, ..OPEN };

pub fn forest(cells: [usize; 3], cut_out: &[usize], start: u8, max: u8) -> BisectionForest {
    let mut domain = Domain::full(Lattice::new(cells, max));
    domain.exclude(cut_out);
    BisectionForest::new(domain, Arc::new(LabelTree::homogeneous(cells, 1)), start, max).unwrap()
}

/// Positions in root cubes, by vertex number.
pub fn positions(f: &BisectionForest) -> Vec<Vector3<f64>> {
    let unit = f64::from(f.domain().lattice().units);
    let mut x = vec![Vector3::zeros(); f.vertex_capacity()];
    for v in f.vertices() {
        x[v.index()] = Vector3::from(f.point(v).map(|c| f64::from(c) / unit));
    }
    x
}

/// How often each directed edge is passed, less how often the other way; and how often at all.
pub fn edge_counts(surface: &IsoSurface) -> BTreeMap<[u32; 2], (i32, i32)> {
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
pub fn assert_closed(surface: &IsoSurface) {
    for (edge, count) in edge_counts(surface) {
        assert_eq!(count, (0, 2), "edge {edge:?}");
    }
}

pub fn assert_valid(surface: &IsoSurface, points: &[Vector3<f64>]) {
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

pub fn sample(f: &BisectionForest, field: impl Fn(Vector3<f64>) -> f64) -> Vec<f64> {
    positions(f).into_iter().map(field).collect()
}

/// Off every symmetry plane of the lattice.
pub const CENTRE: [f64; 3] = [1.017, 0.988, 1.009];
