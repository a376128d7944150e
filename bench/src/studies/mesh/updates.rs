//! What a vertex in and out again costs in meshes of fixed depth and growing extent.

use std::hint::black_box;
use std::time::Instant;

use serde::Serialize;
use yawara_mesh::{BisectionForest, MeshDelta, Point};

use crate::error::Result;
use crate::harness::statistics::{median, percentile, ratios};
use crate::workloads::random::SplitMix64;

/// The cost of a split and its merge at one kind of places.
#[derive(Clone, Debug, Serialize)]
pub(super) struct UpdateCost {
    /// Time of a split with its merge, ns: the tenth percentile of the batches' means.
    pub split_and_merge_ns: f64,
    /// Reading and writing the memory of the same rings once, ns: the tenth percentile.
    pub ring_pass_ns: f64,
    /// Median over the batches of the ratio of the two.
    pub ratio: f64,
}

/// A split and its merge in a mesh of fixed depth.
#[derive(Clone, Debug, Serialize)]
pub(super) struct UpdateRow {
    pub leaves: usize,
    /// Places drawn anew for every batch from the whole mesh: nearly none is in a cache when the
    /// mesh is larger than that.
    pub random: UpdateCost,
    /// Places one beside the other, in a sweep through the mesh.
    pub local: UpdateCost,
    pub bytes_per_leaf: f64,
}

/// Places per batch: long enough for the clock, short enough for many batches.
const BATCH: usize = 512;

/// Batches that count; as many come before and warm what stays warm.
const BATCHES: usize = 32;

/// Bytes of the forest per number of a tetrahedron: 8 in a diamond of 320.
const BYTES_PER_TET: usize = 40;

/// Most children of a ring.
const CHILDREN: usize = 16;

/// Times splits with their merges in `forest`, which is as before afterwards.
pub(super) fn row(forest: &mut BisectionForest) -> Result<UpdateRow> {
    let units = forest.domain().lattice().units;
    let mut places = forest.candidates();
    // Root cube by root cube.
    places.sort_by_key(|&[x, y, z]| ([z, y, x].map(|c| c / units), [z, y, x]));
    let mut random = SplitMix64(2);
    let mut scattered = || (0..BATCH).map(|_| places[random.below(places.len())]).collect();
    let random = cost(forest, &mut scattered)?;
    let mut from = places.len() / 2;
    let mut sweep = || {
        let batch = (from..from + BATCH).map(|i| places[i % places.len()]).collect();
        from += BATCH;
        batch
    };
    let local = cost(forest, &mut sweep)?;
    Ok(UpdateRow {
        leaves: forest.leaf_count(),
        random,
        local,
        bytes_per_leaf: forest.bytes() as f64 / forest.leaf_count() as f64,
    })
}

fn cost(forest: &mut BisectionForest, batch: &mut dyn FnMut() -> Vec<Point>) -> Result<UpdateCost> {
    let mut delta = MeshDelta::empty();
    let children = forest.tet_capacity();
    let mut memory = vec![[1u8; BYTES_PER_TET]; children + CHILDREN];
    let (mut times, mut passes) = (Vec::new(), Vec::new());
    for round in 0..2 * BATCHES {
        let points = batch();
        let begin = Instant::now();
        for &p in &points {
            let vertex = forest.split(black_box(p), &mut delta)?;
            forest.merge(vertex, &mut delta)?;
        }
        let split = begin.elapsed().as_nanos() as f64 / BATCH as f64;
        // Other places than those just split, so that neither side warms the other's caches.
        let rings = rings_at(forest, &batch(), children);
        let begin = Instant::now();
        for &tet in &rings {
            for byte in black_box(&mut memory[tet]) {
                *byte = byte.wrapping_add(1);
            }
        }
        let pass = begin.elapsed().as_nanos() as f64 / BATCH as f64;
        if round >= BATCHES {
            times.push(split);
            passes.push(pass);
        }
    }
    Ok(UpdateCost {
        split_and_merge_ns: percentile(&times, 10.0),
        ring_pass_ns: percentile(&passes, 10.0),
        ratio: median(&ratios(&times, &passes)),
    })
}

/// Where the rings at these places lie: the parents all over the forest, the children of one ring
/// after the other from `children` on, as a merge frees the memory that the next split takes.
fn rings_at(forest: &BisectionForest, points: &[Point], children: usize) -> Vec<usize> {
    let mut numbers = Vec::new();
    let mut ring = Vec::new();
    for &p in points {
        forest.split_ring(p, &mut ring);
        for (i, tet) in ring.iter().enumerate() {
            let first = children + 2 * i;
            numbers.extend([tet.id.index(), first, first + 1]);
        }
    }
    numbers
}
