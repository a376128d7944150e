//! Homogenising an organ, and the hand-over of one ring. With the times goes how far the parts of
//! the hand-over are from describing the same stiffness.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use yawara_bench::{History, Organ, Size};
use yawara_embed::{ElementFormulation, P1};
use yawara_mesh::{MeshDelta, VertexId};

const HOMOGENISATIONS: [&str; 2] = ["linear", "laminate"];

/// Splits whose rings are measured.
const RINGS: usize = 64;

fn homogenise(c: &mut Criterion) {
    let organ = Organ::new(Size::Full).expect("the phantom's constants are valid");
    let mut group = c.benchmark_group("embed/organ");
    group.sample_size(10);
    for name in HOMOGENISATIONS {
        group.bench_function(name, |b| b.iter(|| organ.embedding(black_box(name))));
    }
    group.finish();
}

fn ring(c: &mut Criterion) {
    let organ = Organ::new(Size::Full).expect("the phantom's constants are valid");
    let mut group = c.benchmark_group("embed/ring");
    for name in HOMOGENISATIONS {
        let embedding = organ.embedding(name).expect("a built-in homogenisation");
        let mut forest = organ.forest.clone();
        let points = forest.candidates();
        let deltas: Vec<MeshDelta> = (0..RINGS)
            .map(|i| {
                let mut delta = MeshDelta::empty();
                let point = points[i * points.len() / RINGS];
                let vertex = forest.split(point, &mut delta).expect("a candidate");
                forest.merge(vertex, &mut MeshDelta::empty()).expect("just split");
                delta
            })
            .collect();
        let position = |v: VertexId| organ.rest(forest.point(v));
        let mut at = 0;
        group.bench_function(name, |b| {
            b.iter(|| {
                at = (at + 1) % RINGS;
                P1.ring(black_box(&deltas[at]), &embedding, &position)
            });
        });
        report_consistency(&organ, name);
    }
    group.finish();
}

/// The largest relative difference between K_c − a12 A22⁻¹ a12ᵀ − K_p and F Fᵀ − b A22⁻¹ bᵀ.
fn report_consistency(organ: &Organ, name: &str) {
    let mut history = History::new(organ, name, RINGS, 1).expect("a built-in homogenisation");
    let errors = (0..RINGS).map(|_| {
        let update = history.split().expect("a start mesh can be split");
        update.ring.consistency_error()
    });
    let worst = errors.fold(0.0, f64::max);
    eprintln!("embed/ring/{name}: consistency error {worst:.1e} over {RINGS} rings\n");
}

criterion_group!(benches, homogenise, ring);
criterion_main!(benches);
