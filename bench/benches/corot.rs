//! Forces and an equilibrium under gravity. With the times go the net force, which has to vanish,
//! and the residual of the equilibrium.

use std::hint::black_box;
use std::time::Instant;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use yawara::inverse::SlotMap;
use yawara_bench::{History, Organ, Size, Solid};
use yawara_corot::{
    Body, ElementCorotation, ElementReference, InternalForces, Outcome, Problem, StiffnessPacket,
    Tolerance, equilibrium_by_name, forces_by_name,
};
use yawara_embed::{Embedding, isotropic};
use yawara_inverse_update::{InverseMaintainer, build};

/// A tenth of that on earth, m/s²: nothing but the held back carries the organ, which is soft.
const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -0.98);

/// A body that is ready to be solved.
struct Case {
    body: Body,
    rest: Vec<Vector3<f64>>,
    free: Vec<bool>,
    weight: Vec<Vector3<f64>>,
    slots: SlotMap,
    inverse: Box<dyn InverseMaintainer>,
}

impl Case {
    fn new(size: Size) -> Self {
        let organ = Organ::new(size).expect("the phantom's constants are valid");
        let embedding = organ.embedding("laminate").expect("a built-in homogenisation");
        let history = History::new(&organ, "laminate", 0, 1).expect("a built-in homogenisation");
        let stiffness = history.stiffness().expect("finite elements");
        let body = organ.body(&embedding);
        let rest = organ.rest_positions();
        let mut free = vec![false; rest.len()];
        for v in organ.free_vertices() {
            free[v.index()] = true;
        }
        Self {
            weight: weight(&organ, &embedding, &body, rest.len()),
            inverse: build("woodbury", stiffness).expect("a held body"),
            slots: history.slots().clone(),
            body,
            rest,
            free,
        }
    }

    fn solve(&self, body: &mut Body, positions: &mut [Vector3<f64>]) -> Outcome {
        let corotation = forces_by_name("element").expect("built in");
        let mut equilibrium = equilibrium_by_name("anderson").expect("built in");
        let inverse = |f: &[f64], u: &mut [f64]| {
            let load = self.slots.gather(3, f);
            let mut displacement = vec![0.0; load.len()];
            self.inverse.solve(&load, &mut displacement).expect("finite loads");
            self.slots.scatter(3, &displacement, u);
        };
        let mut problem = Problem {
            body,
            forces: corotation.as_ref(),
            inertia: None,
            external: &self.weight,
            free: &self.free,
            constraints: None,
            pushes: None,
            following: &[],
            inverse: &inverse,
        };
        let mut internal = vec![Vector3::zeros(); positions.len()];
        let tolerance = Tolerance::new(1e-6, 60);
        equilibrium.solve(&mut problem, positions, &mut internal, &tolerance)
    }
}

/// A quarter of each tetrahedron's weight on each of its corners, N.
fn weight(organ: &Organ, embedding: &Embedding, body: &Body, vertices: usize) -> Vec<Vector3<f64>> {
    let mut weight = vec![Vector3::zeros(); vertices];
    for tet in organ.forest.leaves() {
        let element = body.element(tet.id).expect("one element per leaf");
        let share = 0.25 * element.geometry.volume * embedding.density(tet.node) * GRAVITY;
        for v in element.vertices {
            weight[v] += share;
        }
    }
    weight
}

fn forces(c: &mut Criterion) {
    let Case { mut body, rest, .. } = Case::new(Size::Full);
    let corotation = forces_by_name("element").expect("built in");
    // A bend about the y axis, a third of a radian at the far end.
    let bent: Vec<Vector3<f64>> =
        rest.iter().map(|x| x + Vector3::new(0.0, 0.0, 0.8 * x.x * x.x)).collect();
    let mut forces = vec![Vector3::zeros(); bent.len()];
    c.bench_function("corot/element_forces", |b| {
        b.iter(|| corotation.internal_forces(&mut body, black_box(&bent), &mut forces));
    });
    let scale = corotation.internal_forces(&mut body, &bent, &mut forces);
    let net = forces.iter().sum::<Vector3<f64>>().norm() / scale;
    eprintln!("corot/element_forces: net force {net:.1e} of the element forces\n");
}

/// Forces and stiffness of 16 800 tetrahedra, by the vector kernels and one by one. The mark is
/// 8.4 ms: internal forces and rotated stiffness by Vega FEM, one thread of such a core.
fn kernels(c: &mut Criterion) {
    let solid = Solid::block([20, 14, 10], [2.0, 1.4, 1.0], isotropic(1e4, 0.45));
    let bent: Vec<Vector3<f64>> =
        solid.points.iter().map(|x| x + Vector3::new(0.0, 0.0, 0.2 * x.x * x.x)).collect();
    let slightly = |step: usize| -> Vec<Vector3<f64>> {
        bent.iter().map(|x| x * (1.0 + 1e-3 * step as f64)).collect()
    };
    // Between two poses, so that rotations are warm but not yet there.
    let poses = [slightly(0), slightly(1)];
    let mut body = solid.body();
    let mut forces = vec![Vector3::zeros(); bent.len()];
    let mut blocks: Vec<StiffnessPacket> = vec![[[0.0; 8]; 144]; solid.tets.len().div_ceil(8)];
    let mut group = c.benchmark_group("corot/16800_tets");
    let mut turn = 0;
    for name in ["element", "element_reference"] {
        let corotation = forces_by_name(name).expect("built in");
        group.bench_function(format!("{name}_forces"), |b| {
            b.iter(|| {
                turn ^= 1;
                corotation.internal_forces(&mut body, black_box(&poses[turn]), &mut forces)
            });
        });
    }
    group.bench_function("element_forces_and_stiffness", |b| {
        b.iter(|| {
            turn ^= 1;
            body.forces_and_stiffness(black_box(&poses[turn]), &mut forces, &mut blocks)
        });
    });
    group.finish();
    let mut least_of_many = || {
        // On a machine with other work the least of many is nearest to the truth.
        let mut least = [f64::INFINITY; 3];
        for round in 0..200 {
            let x = &poses[round % 2];
            for (which, least) in least.iter_mut().enumerate() {
                // Each begins with the rotations of the other pose.
                ElementCorotation.internal_forces(&mut body, &poses[1 - round % 2], &mut forces);
                let begin = Instant::now();
                match which {
                    0 => ElementReference.internal_forces(&mut body, x, &mut forces),
                    1 => ElementCorotation.internal_forces(&mut body, x, &mut forces),
                    _ => body.forces_and_stiffness(x, &mut forces, &mut blocks),
                };
                *least = least.min(begin.elapsed().as_secs_f64() * 1e3);
            }
        }
        least
    };
    let shared = least_of_many();
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let alone = single.install(least_of_many);
    for (threads, [reference, forces_ms, both]) in
        [(1, alone), (rayon::current_num_threads(), shared)]
    {
        eprintln!(
            "corot/16800_tets, {threads} thread(s), least of 200: forces {forces_ms:.2} ms, with \
             stiffness {both:.2} ms (mark on one: 8.4 ms), reference forces {reference:.2} ms"
        );
    }
    let scale = body.forces_and_stiffness(&bent, &mut forces, &mut blocks);
    let fast = forces.clone();
    ElementReference.internal_forces(&mut body, &bent, &mut forces);
    let error = fast.iter().zip(&forces).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt();
    eprintln!("corot/16800_tets: {:.1e} from the reference, relative\n", error / scale);
}

fn equilibrium(c: &mut Criterion) {
    let mut group = c.benchmark_group("corot/anderson_gravity");
    group.sample_size(10);
    for (name, size) in [("quick", Size::Quick), ("full", Size::Full)] {
        let case = Case::new(size);
        group.bench_function(name, |b| {
            b.iter_batched_ref(
                || (case.body.clone(), case.rest.clone()),
                |(body, positions)| case.solve(body, black_box(positions)),
                BatchSize::LargeInput,
            );
        });
        let (mut body, mut positions) = (case.body.clone(), case.rest.clone());
        let Outcome { iterations, residual, converged, .. } = case.solve(&mut body, &mut positions);
        let moved = positions.iter().zip(&case.rest).map(|(x, y)| (x - y).norm());
        let moved_mm = 1e3 * moved.fold(0.0, f64::max);
        eprintln!(
            "corot/anderson_gravity/{name}: residual {residual:.1e} after {iterations} \
             iterations, converged: {converged}, largest displacement {moved_mm:.1} mm\n"
        );
    }
    group.finish();
}

criterion_group!(benches, forces, kernels, equilibrium);
criterion_main!(benches);
