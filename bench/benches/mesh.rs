//! Labels, start mesh, and one vertex in and out. The mesh stage is exact: what goes with its
//! times is a check that the forest came back to where it was.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use yawara_bench::{Organ, Size};
use yawara_mesh::phantom::liver;
use yawara_mesh::{BisectionForest, ClosureQueue, LabelTree, MeshDelta, Point};

fn set_up(c: &mut Criterion) {
    let organ = Organ::new(Size::Full).expect("the phantom's constants are valid");
    let mut group = c.benchmark_group("mesh/set_up");
    group.sample_size(10);
    group.bench_function("phantom", |b| b.iter(|| liver(black_box(Size::Full.phantom()))));
    let grid = *organ.tree.grid();
    group.bench_function("label_tree", |b| {
        b.iter(|| LabelTree::new(black_box(&organ.volume), grid));
    });
    let domain = organ.forest.domain();
    group.bench_function("start_forest", |b| {
        b.iter(|| BisectionForest::new(domain.clone(), organ.tree.clone(), 0, 6));
    });
    group.finish();
}

fn split_and_merge(c: &mut Criterion) {
    let organ = Organ::new(Size::Full).expect("the phantom's constants are valid");
    let mut forest = organ.forest.clone();
    let points = forest.candidates();
    let (vertices, leaves) = (forest.vertex_count(), forest.leaf_count());
    let mut delta = MeshDelta::empty();
    let mut at = 0;
    c.bench_function("mesh/split_and_merge", |b| {
        b.iter(|| {
            at = (at + 1) % points.len();
            let vertex = forest.split(black_box(points[at]), &mut delta).expect("a candidate");
            forest.merge(vertex, &mut delta).expect("just split");
        });
    });
    let point = deepest(&mut forest);
    c.bench_function("mesh/split_with_closure_and_merge_all", |b| {
        b.iter(|| {
            forest
                .split_with_closure(black_box(point), &mut delta, |_, _| ())
                .expect("in the body");
            forest.merge_all().expect("a valid forest");
        });
    });
    let mut queue = ClosureQueue::with_capacity(1);
    c.bench_function("mesh/drain_closure_and_merge_all", |b| {
        b.iter(|| {
            queue.push(black_box(point), 1.0).expect("finite");
            queue
                .drain(&mut forest, usize::MAX, || false, &mut delta, |_, _| ())
                .expect("in the body");
            forest.merge_all().expect("a valid forest");
        });
    });
    assert_eq!((forest.vertex_count(), forest.leaf_count()), (vertices, leaves));
    assert_eq!(forest.candidates(), points, "the forest did not come back to its start");
    eprintln!("mesh: back at the start mesh, {vertices} vertices, {leaves} tets\n");
}

/// A point of the finest generation near the middle of the body; leaves the start mesh behind.
fn deepest(forest: &mut BisectionForest) -> Point {
    let mut delta = MeshDelta::empty();
    for _ in forest.start_level()..forest.max_level() - 1 {
        let lattice = *forest.domain().lattice();
        let candidates = forest.candidates();
        let newest = candidates.iter().copied().max_by_key(|&p| lattice.generation(p));
        let point = newest.expect("above the finest level");
        forest.split(point, &mut delta).expect("a candidate");
    }
    let lattice = *forest.domain().lattice();
    let newest = forest.candidates().into_iter().max_by_key(|&p| lattice.generation(p));
    let point = newest.expect("above the finest level");
    forest.merge_all().expect("a valid forest");
    point
}

criterion_group!(benches, set_up, split_and_merge);
criterion_main!(benches);
