//! The hot path allocates nothing: splits, merges and drained closures, once warm.
//!
//! Warm means that the mesh, and the lists of free numbers, have had their largest size: memory
//! is kept and used again. The pages of the map of points are there from the start.

use std::sync::Arc;

use allocation_counter::measure;
use yawara_mesh::{BisectionForest, ClosureQueue, Domain, LabelTree, Lattice, MeshDelta, Point};

/// Allocations of this thread: the test harness's own threads don't disturb.
fn allocations(work: impl FnOnce()) -> u64 {
    measure(work).count_total
}

fn forest(start: u8, max: u8) -> BisectionForest {
    let cells = [2, 2, 2];
    let mut domain = Domain::full(Lattice::new(cells, max));
    domain.exclude(&[1, 6]);
    BisectionForest::new(domain, Arc::new(LabelTree::homogeneous(cells, 1)), start, max).unwrap()
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 1);
    assert!(allocations(|| drop(std::hint::black_box(vec![0; 4]))) >= 1);
    assert_eq!(allocations(|| ()), 0);
}

#[test]
fn splits_and_merges_allocate_nothing_once_warm() {
    let mut f = forest(2, 9);
    let mut delta = MeshDelta::empty();
    let mut vertices = Vec::with_capacity(10_000);
    let points = refine(&mut f, 7);
    assert!(points.len() > 400, "{}", points.len());
    f.merge_all().unwrap();
    for _ in 0..3 {
        let count = allocations(|| {
            for &p in &points {
                vertices.push(f.split(p, &mut delta).unwrap());
                let v = vertices[vertices.len() - 1];
                f.merge(v, &mut delta).unwrap();
                f.split(p, &mut delta).unwrap();
            }
            while let Some(v) = vertices.pop() {
                f.merge(v, &mut delta).unwrap();
            }
        });
        assert_eq!(count, 0);
    }
}

/// Splits at all candidates until every leaf has `level`; the points in the order of the splits.
fn refine(f: &mut BisectionForest, level: u8) -> Vec<Point> {
    let lattice = *f.domain().lattice();
    let mut delta = MeshDelta::empty();
    let mut points = Vec::new();
    loop {
        let mut found = f.candidates();
        found.retain(|&p| lattice.generation(p) <= level);
        if found.is_empty() {
            return points;
        }
        for p in found {
            f.split(p, &mut delta).unwrap();
            points.push(p);
        }
    }
}

#[test]
fn a_drained_queue_allocates_nothing_once_warm() {
    let mut f = forest(0, 12);
    let mut delta = MeshDelta::empty();
    let mut queue = ClosureQueue::with_capacity(64);
    let requests: Vec<Point> = (0..64).map(|i| [1 + i % 8, 2 + i % 13, 3 + i % 11]).collect();
    let mut came_in = Vec::with_capacity(20_000);
    for round in 0..3 {
        let count = allocations(|| {
            for (i, &p) in requests.iter().enumerate() {
                queue.push(p, (i % 7) as f64).unwrap();
            }
            while !queue.is_empty() {
                let visit = |_: &BisectionForest, d: &MeshDelta| came_in.push(d.vertex);
                queue.drain(&mut f, 5, || false, &mut delta, visit).unwrap();
                // One goes out again between two slices: the closure is derived anew.
                if let Some(v) = came_in.pop_if(|v| f.is_mergeable(*v) && v.0 % 5 == 0) {
                    f.merge(v, &mut delta).unwrap();
                }
            }
            while let Some(v) = came_in.pop() {
                f.merge(v, &mut delta).unwrap();
            }
        });
        assert!(count == 0 || round == 0, "{count} allocations in round {round}");
    }
}
