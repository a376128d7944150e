//! From a label volume to refined meshes and smooth surfaces.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_mesh::isosurface::{IsoSurface, LabelField, SurfaceOptions};
use yawara_mesh::phantom::block;
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{BisectionForest, CellGrid, Domain, LabelTree, Lattice, Region, Tet};

use crate::checks::{assert_closed, assert_valid, positions};

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
    // Positions in voxels, from the corner of the volume.
    let first = Vector3::from(f.tree().grid().first_voxel.map(|c| c as f64));
    let x: Vec<Vector3<f64>> = positions(&f).into_iter().map(|x| first + 8.0 * x).collect();
    // Label 1 is a shell (two spheres), label 2 its core.
    for (label, spheres) in [(1, 2), (2, 1)] {
        let field = LabelField::blurred(&volume, label, 1.0).unwrap().on_vertices(&f);
        let surface = IsoSurface::of_forest(&f, &field, SurfaceOptions::of_label(label)).unwrap();
        let points = surface.positions(&x).unwrap();
        assert_closed(&surface);
        assert_valid(&surface, &points);
        let counts = (surface.component_count(), surface.euler_characteristic());
        assert_eq!((counts, surface.label), ((spheres, 2 * spheres as i64), label));
        // The ball lies in the middle; its mesh is not quite symmetric.
        let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        assert!((mean - Vector3::repeat(32.0)).norm() < 0.2, "{mean}");
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
    let several = |tet: &Tet| f.tree().labels(tet.node).as_slice().len() > 1;
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
