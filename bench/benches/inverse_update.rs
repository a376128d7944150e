//! Updates, solves and rebuilds of the inverse. With the times goes the error of the inverse that
//! was kept through all of them, against a fresh one. To compare maintainers, run the study
//! `table1`: there they take turns.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use yawara_bench::{History, Organ, Size, Update, inverse_error};
use yawara_inverse_update::{CHOICES, InverseMaintainer, Lu, SparseStiffness, build, drift};
use yawara_mesh::Change;

/// Rings that take turns.
const RINGS: usize = 32;

/// The start mesh's stiffness and splits that are possible on it, each followed by its merge.
fn pairs(organ: &Organ, homogenisation: &str) -> (SparseStiffness, Vec<[Update; 2]>) {
    let mut history = History::new(organ, homogenisation, 1, 7).expect("built in");
    let stiffness = history.stiffness().expect("finite elements");
    let pairs = (0..RINGS)
        .map(|_| {
            let split = history.step().expect("a start mesh can be split");
            let merge = history.step().expect("just split");
            assert_eq!([split.kind, merge.kind], [Change::Split, Change::Merge]);
            [split, merge]
        })
        .collect();
    (stiffness, pairs)
}

fn report_error(name: &str, maintainer: &dyn InverseMaintainer, updates: usize) {
    let lu = Lu::new(maintainer.stiffness().clone()).expect("a held body");
    let all: Vec<usize> = (0..lu.vertices()).collect();
    let reference = lu.columns(&all).expect("all slots");
    let error = inverse_error(maintainer, &reference).expect("all slots");
    let drift = drift(maintainer, 1, 8);
    eprintln!(
        "{name}: after {updates} updates relative error {error:.1e} against lu, drift {drift:.1e}, \
         {} rebuilds\n",
        maintainer.counts().rebuilds
    );
}

/// One split and the merge that undoes it, by every maintainer that updates.
fn split_and_merge(c: &mut Criterion) {
    let mut group = c.benchmark_group("inverse_update/split_and_merge");
    group.sample_size(20);
    for (label, size) in [("quick", Size::Quick), ("full", Size::Full)] {
        let organ = Organ::new(size).expect("the phantom's constants are valid");
        for homogenisation in ["linear", "laminate"] {
            let (stiffness, pairs) = pairs(&organ, homogenisation);
            for &choice in CHOICES.iter().filter(|choice| **choice != "lu") {
                let mut maintainer = build(choice, stiffness.clone()).expect("a held body");
                let mut updates = 0;
                let id = BenchmarkId::new(format!("{choice}_{homogenisation}"), label);
                group.bench_function(id, |b| {
                    b.iter(|| {
                        for update in black_box(&pairs[updates / 2 % RINGS]) {
                            update.apply(maintainer.as_mut()).expect("a valid update");
                            updates += 1;
                        }
                    });
                });
                let name = format!("split_and_merge/{choice}_{homogenisation}/{label}");
                report_error(&name, maintainer.as_ref(), updates);
            }
        }
    }
    group.finish();
}

/// u = C f after a split, the columns of a tool of three vertices, and a start afresh.
fn solve_and_rebuild(c: &mut Criterion) {
    let organ = Organ::new(Size::Quick).expect("the phantom's constants are valid");
    let mut group = c.benchmark_group("inverse_update/quick");
    group.sample_size(10);
    for &choice in CHOICES {
        let (stiffness, pairs) = pairs(&organ, "laminate");
        let mut maintainer = build(choice, stiffness).expect("a held body");
        pairs[0][0].apply(maintainer.as_mut()).expect("a valid update");
        let load = vec![1.0; maintainer.stiffness().dofs()];
        let mut displacement = load.clone();
        group.bench_function(BenchmarkId::new("solve", choice), |b| {
            b.iter(|| maintainer.solve(black_box(&load), &mut displacement));
        });
        group.bench_function(BenchmarkId::new("columns", choice), |b| {
            b.iter(|| maintainer.columns(black_box(&[3, 1, 4])));
        });
        group.bench_function(BenchmarkId::new("rebuild", choice), |b| {
            b.iter(|| maintainer.rebuild());
        });
        report_error(&format!("rebuild/{choice}"), maintainer.as_ref(), 1);
    }
    group.finish();
}

criterion_group!(benches, split_and_merge, solve_and_rebuild);
criterion_main!(benches);
