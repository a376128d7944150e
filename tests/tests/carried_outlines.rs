//! Outlines that a coarse mesh carries, against where a mesh of voxels has them.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use yawara::{Simulation, Stages, scene_file};
use yawara_corot::rotation::polar_warm;
use yawara_embed::{DetailMesh, Embedding, Material, by_name};
use yawara_mesh::isosurface::{IsoSurface, Outline, Outlines};
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::{BisectionForest, CellGrid, Domain, LabelTree, Lattice};

/// Level of one voxel of 4 mm in base cells of 16 mm.
const VOXEL_LEVEL: u8 = 6;

/// A place to a micrometre.
fn key(x: &Vector3<f64>) -> [i64; 3] {
    [0, 1, 2].map(|axis| (x[axis] * 1e6).round() as i64)
}

/// Where every vertex of the built-in liver in voxels of 4 mm is after the first step of its pull, by
/// its place at rest: one vertex per corner of a voxel, nothing is homogenised.
fn pulled_voxels() -> HashMap<[i64; 3], Vector3<f64>> {
    let set = [
        "image.voxel_mm=4.0",
        "mesh.start_level=6",
        "mesh.max_vertices=40000",
        "stages.element=p1",
    ];
    let (scene, _) = scene_file::load("liver", &set.map(String::from)).unwrap();
    let stages = Stages::by_name(&scene.stages).unwrap();
    let mut simulation = Simulation::new(&scene, stages).unwrap();
    assert!(simulation.step().unwrap().converged);
    let body = simulation.body();
    let (rest, now) = (body.rest_positions(), body.positions());
    body.vertices().map(|v| (key(&rest[v.index()]), now[v.index()])).collect()
}

/// Mean and largest distance of the vertices of `surface`, mm.
fn distance(surface: &IsoSurface, x: &[Vector3<f64>], y: &[Vector3<f64>]) -> [f64; 2] {
    let (x, y) = (surface.positions(x).unwrap(), surface.positions(y).unwrap());
    let off: Vec<f64> = x.iter().zip(&y).map(|(x, y)| 1e3 * (x - y).norm()).collect();
    [off.iter().sum::<f64>() / off.len() as f64, off.iter().copied().fold(0.0, f64::max)]
}

/// Coarse vertices are where the voxels have them, so that all error is that of the places between.
#[test]
fn embedded_outlines_are_nearer_to_those_of_voxels_than_middles() {
    let truth = pulled_voxels();
    let volume = liver(LiverPhantom { length_mm: 196.0, voxel_mm: 4.0, seed: 1 }).unwrap();
    let grid = CellGrid::around(&volume, 4).unwrap();
    let tree = Arc::new(LabelTree::new(&volume, grid).unwrap());
    let solid = |e: f64| Material::new(e, 0.45, 1060.0).unwrap();
    let void = Material::new(1.0, 0.0, 0.0).unwrap();
    let materials = vec![void, solid(5e3), solid(5e5), solid(2e4), solid(5e4)];
    let homogenisation = by_name("laminate").unwrap();
    let embedding = Embedding::new(Arc::clone(&tree), materials, homogenisation).unwrap();
    let domain = || Domain::of_labels(Lattice::new(grid.cells, VOXEL_LEVEL), &tree);
    let asked = [(1, 1.0), (2, 0.5), (3, 1.0), (4, 1.0)];
    let asked = asked.map(|(label, sigma_voxels)| Outline { label, sigma_voxels });
    let Outlines { forest, placement, rest, surfaces } =
        Outlines::new(&volume, &tree, domain(), VOXEL_LEVEL, &asked).unwrap();
    // Numbers not in use have no place.
    let want: Vec<_> = rest.iter().map(|x| truth.get(&key(x)).copied().unwrap_or(*x)).collect();
    let middles = DetailMesh::new(forest.clone());
    let embedded = DetailMesh::embedded(forest, &embedding, placement.unit).unwrap();
    for level in [0, 3] {
        let active = BisectionForest::new(domain(), Arc::clone(&tree), level, VOXEL_LEVEL).unwrap();
        let mut x = vec![Vector3::zeros(); active.vertex_capacity()];
        for v in active.vertices() {
            x[v.index()] = truth[&key(&placement.position(active.point(v)))];
        }
        let turn = |f: &Matrix3<f64>| polar_warm(f, &Matrix3::identity());
        let [middles, embedded] =
            [&middles, &embedded].map(|mesh| mesh.positions(&active, &x, &turn).unwrap());
        for surface in &surfaces {
            let [mean, most] = distance(surface, &embedded, &want);
            let [plain_mean, plain_most] = distance(surface, &middles, &want);
            let label = surface.label;
            println!(
                "level {level}, label {label}: mean {mean:.4}, most {most:.3} mm; \
                 middles {plain_mean:.4}, {plain_most:.3}"
            );
            // A tumour of a coarse tetrahedron's size is no layer: a tenth farther at most. Vessels
            // and gallbladder are what displaced vertices are for.
            let (of_mean, of_most) = if label == 4 { (1.1, 1.1) } else { (1.0, 1.01) };
            assert!(mean <= of_mean * plain_mean && most <= of_most * plain_most);
            assert!(label != 2 || mean < 0.9 * plain_mean);
        }
    }
}
