//! The volume part of `mesh`: what it costs to take in a cube of voxels with an organ in it.

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{BisectionForest, CellGrid, Domain, LabelTree, Lattice, Region};

use crate::bodies::solid::places;
use crate::error::Result;
use crate::harness::machine;
use crate::harness::report::markdown::{self, Column};

/// Voxels along a root cube.
const VOXELS_PER_CELL: usize = 16;

/// A cube of voxels with a liver phantom in its middle, taken in.
#[derive(Clone, Debug, Serialize)]
pub(super) struct VolumeRow {
    /// Voxels along a side.
    pub size: usize,
    pub voxels: usize,
    /// Heterogeneous tetrahedra.
    pub nodes: usize,
    /// Time of the label tree, which has the exact labels of every tetrahedron.
    pub seconds: f64,
    pub voxels_per_second: f64,
    pub bytes_per_node: f64,
    /// Leaves of a forest split, with closures, wherever labels meet, down to voxels.
    pub forest_leaves: usize,
    pub forest_seconds: f64,
    pub forest_bytes_per_leaf: f64,
    /// Leaves that the uniform forest of that level would have.
    pub uniform_leaves: u64,
    /// Largest memory of the process so far, voxels included, MiB; 0 where it is not known.
    pub peak_mib: f64,
}

/// Measures a cube of `size`³ voxels.
pub(super) fn row(size: usize) -> Result<VolumeRow> {
    let volume = cube(size)?;
    let voxels = volume.labels().len();
    let grid = CellGrid::around(&volume, VOXELS_PER_CELL)?;
    let mut seconds = f64::INFINITY;
    let mut tree = LabelTree::homogeneous([1; 3], 0);
    for _ in 0..3 {
        let begin = Instant::now();
        tree = LabelTree::new(&volume, grid)?;
        seconds = seconds.min(begin.elapsed().as_secs_f64());
    }
    let (nodes, bytes) = (tree.node_count(), tree.bytes());
    let level = grid.embed_level();
    let begin = Instant::now();
    let tree = Arc::new(tree);
    let domain = Domain::of_labels(Lattice::new(grid.cells, level), &tree);
    let roots = 6 * domain.cells().count() as u64;
    let mut forest = BisectionForest::new(domain, tree, 0, level)?;
    forest.refine_to_labels(level, usize::MAX, Region::Everywhere)?;
    let forest_seconds = begin.elapsed().as_secs_f64();
    Ok(VolumeRow {
        size,
        voxels,
        nodes,
        seconds,
        voxels_per_second: voxels as f64 / seconds,
        bytes_per_node: bytes as f64 / nodes as f64,
        forest_leaves: forest.leaf_count(),
        forest_seconds,
        forest_bytes_per_leaf: forest.bytes() as f64 / forest.leaf_count() as f64,
        uniform_leaves: roots << level,
        peak_mib: machine::peak_bytes().unwrap_or(0) as f64 / f64::from(1 << 20),
    })
}

/// The liver phantom, scaled to fill a cube of voxels along its longest side.
fn cube(size: usize) -> Result<LabelVolume> {
    let length_mm = 200.0;
    // The organ with its margin of background fills the cube along its longest side.
    let voxel_mm = length_mm / (size as f64 - 4.0);
    let organ = liver(LiverPhantom { length_mm, voxel_mm, seed: 1 })?;
    let from = organ.grid().dims;
    let first = from.map(|d| size.saturating_sub(d) / 2);
    let mut labels = vec![0; size.pow(3)];
    for [x, y, z] in places(from.map(|d| d.min(size))) {
        let at = first[0] + x + size * (first[1] + y + size * (first[2] + z));
        labels[at] = organ.get(x, y, z);
    }
    let grid = Grid::centred([size; 3], voxel_mm);
    Ok(LabelVolume::new(grid, labels, organ.values().to_vec())?)
}

/// The rows for people.
pub(super) fn table(rows: &[VolumeRow]) -> String {
    let columns: [Column<VolumeRow>; 11] = [
        ("size³", |r| r.size.to_string()),
        ("Mvoxel", |r| format!("{:.1}", r.voxels as f64 / 1e6)),
        ("mixed tets", |r| r.nodes.to_string()),
        ("tree s", |r| format!("{:.2}", r.seconds)),
        ("Mvoxel/s", |r| format!("{:.1}", r.voxels_per_second / 1e6)),
        ("bytes/tet", |r| format!("{:.1}", r.bytes_per_node)),
        ("leaves where labels meet", |r| r.forest_leaves.to_string()),
        ("uniform", |r| format!("{:.1e}", r.uniform_leaves as f64)),
        ("forest s", |r| format!("{:.2}", r.forest_seconds)),
        ("bytes/leaf", |r| format!("{:.0}", r.forest_bytes_per_leaf)),
        ("peak MiB", |r| format!("{:.0}", r.peak_mib)),
    ];
    markdown::rows(rows, &columns)
}
