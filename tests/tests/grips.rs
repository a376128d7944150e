//! What holds material does not know the mesh: the same energy, force and mean before and after a
//! split, and an inverse that follows.

use std::f64::consts::PI;
use std::sync::Arc;

use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;
use nalgebra::{DVector, Isometry3, Matrix4, Rotation3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara::{Elements, InverseFactory, InverseLink};
use yawara_corot::{Body, Element, Grip, Loads, Problem, Tolerance, WeightedPoint, forces_by_name};
use yawara_embed::{Embedding, LinearTet, formulation_by_name, isotropic};
use yawara_mesh::{BisectionForest, Lattice, MeshDelta, Placement, RingTet, Tet, TetId, VertexId};
use yawara_tests::organ::{Organ, organs};

const MAX_LEVEL: u8 = 8;

/// Springs as stiff as a material of 10⁶ Pa, N/m⁴.
const STIFFNESS: f64 = 1e10;

/// An organ whose mesh changes, held by two pads and by the mean of the same points, with the inverse
/// of its stiffness and the pads'.
struct Gripped {
    forest: BisectionForest,
    placement: Placement,
    embedding: Embedding,
    body: Body,
    link: InverseLink,
    /// By vertex number, m.
    positions: Vec<Vector3<f64>>,
    delta: MeshDelta,
}

/// What is felt of the pad, and by how much the mean's constraints are missed.
#[derive(Debug)]
struct Felt {
    energy: f64,
    force: Vector3<f64>,
    torque: Vector3<f64>,
    lack: DVector<f64>,
}

fn elements(body: &Body) -> Elements<'_> {
    Elements { body, density: &|_| 0.0 }
}

impl Gripped {
    fn new(organ: &Organ, element: &str, points: Vec<WeightedPoint>) -> Self {
        let forest = organ.forest(0, MAX_LEVEL);
        let (placement, embedding) = (organ.placement(MAX_LEVEL), organ.embedding("laminate"));
        let rest: Vec<_> = forest.vertices().map(|v| placement.position(forest.point(v))).collect();
        let mut body = Body::new();
        for tet in forest.leaves() {
            body.insert(element_of(&forest, &placement, &embedding, &tet));
        }
        for stiffness in [Some(STIFFNESS), None, Some(STIFFNESS)] {
            let mut grip =
                Grip::new(points.clone(), stiffness, body.elements().iter(), &rest, |_, _| true)
                    .expect("some points");
            let turn = Vector3::new(0.3, -0.5, 0.2);
            grip.set_pose(Isometry3::new(Vector3::new(1e-3, 2e-3, -5e-4), turn));
            body.add_grip(grip);
        }
        // Any place will do, if it is no rigid motion of rest.
        let positions = rest.iter().map(|x| x + 0.1 * x.component_mul(&x.yzx())).collect();
        let factory: InverseFactory = Box::new(|k| yawara_inverse_update::build("woodbury", k));
        let key = |v| Lattice::key(forest.point(v));
        let formulation = formulation_by_name(element).unwrap();
        let vertices = forest.vertices();
        let link =
            InverseLink::new(&elements(&body), formulation, vertices, |_| false, key, factory)
                .unwrap();
        Self { forest, placement, embedding, body, link, positions, delta: MeshDelta::empty() }
    }

    fn felt(&self) -> Felt {
        let [pad, mean, _] = self.body.grips() else { panic!("three grips") };
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        pad.each_force(&self.positions, |v, f| {
            force += f;
            torque += self.positions[v].cross(&f);
        });
        let lack = mean.constraints().lack(&self.positions);
        Felt { energy: pad.energy(&self.positions), force, torque, lack }
    }

    /// The new vertex lies on its edge: nothing that is felt changes.
    fn split(&mut self, pick: &Index) {
        let candidates = self.forest.candidates();
        let before = self.felt();
        let v = self.forest.split(candidates[pick.index(candidates.len())], &mut self.delta);
        let v = v.unwrap();
        self.positions.resize(self.forest.vertex_capacity(), Vector3::zeros());
        let [a, b] = self.delta.edge.map(|v| self.positions[v.index()]);
        self.positions[v.index()] = 0.5 * (a + b);
        for RingTet { parent, children } in self.delta.ring.clone() {
            self.body.remove(parent.id);
            children.iter().for_each(|child| self.insert(child));
        }
        self.body.grips_follow(&self.delta);
        self.update(v);
        self.link.flush(&elements(&self.body)).unwrap();
        self.same(&before);
    }

    /// The vertex lies on its edge again before it goes.
    fn merge(&mut self, pick: &Index) {
        let ready: Vec<_> =
            self.forest.vertices().filter(|&v| self.forest.is_mergeable(v)).collect();
        if ready.is_empty() {
            return;
        }
        let v = ready[pick.index(ready.len())];
        let before = self.felt();
        self.forest.merge(v, &mut self.delta).unwrap();
        for RingTet { parent, children } in self.delta.ring.clone() {
            for child in &children {
                self.body.remove(child.id);
            }
            self.insert(&parent);
        }
        self.update(v);
        self.body.grips_follow(&self.delta);
        self.link.flush(&elements(&self.body)).unwrap();
        self.same(&before);
    }

    fn insert(&mut self, tet: &Tet) {
        let element = element_of(&self.forest, &self.placement, &self.embedding, tet);
        self.body.insert(element);
    }

    fn update(&mut self, v: VertexId) {
        let position = |v: VertexId| self.placement.position(self.forest.point(v));
        let ring = self.link.element().ring(&self.delta, &self.embedding, &position);
        let ring = ring.with_springs(&self.delta, &|tet| self.body.grip_matrix(tet));
        let key = Lattice::key(self.forest.point(v));
        self.link.push(self.delta.change, v, false, key, ring);
    }

    /// Rounding: a split halves and subtracts barycentric coordinates.
    fn same(&self, before: &Felt) {
        let after = self.felt();
        let limit = 1e-11;
        let weight: f64 = self.body.grips()[0].weight();
        // Of points a centimetre off.
        let (force, length) = (STIFFNESS * weight * 1e-2, 1e-1);
        assert!((after.energy - before.energy).abs() <= limit * force * length, "{after:?}");
        assert!((after.force - before.force).norm() <= limit * force, "{before:?} {after:?}");
        assert!((after.torque - before.torque).norm() <= limit * force * length, "{after:?}");
        assert!((&after.lack - &before.lack).amax() <= limit * length, "{before:?} {after:?}");
    }

    /// Largest entry of the kept inverse less that by dense LU of the stiffness assembled afresh, in
    /// √(C_ii C_jj).
    fn error(&self) -> f64 {
        let m = self.link.element().unknowns();
        let n = m * self.link.maintainer().vertices();
        let mut k = Mat::<f64>::zeros(n, n);
        for e in self.body.elements() {
            let matrix = self.link.element().stiffness(&e.geometry, &e.elasticity);
            let springs = self.springs(e);
            let row = |i: usize| m * self.link.slot(e.vertices[i / m]).unwrap() + i % m;
            for (i, j) in (0..4 * m).flat_map(|i| (0..4 * m).map(move |j| (i, j))) {
                let same_axis = i % m == j % m && i % m < 3;
                let held = if same_axis { springs[(i / m, j / m)] } else { 0.0 };
                k[(row(i), row(j))] += matrix[(i, j)] + held;
            }
        }
        let expected = k.partial_piv_lu().inverse();
        let slots: Vec<usize> = (0..self.link.maintainer().vertices()).collect();
        let got = self.link.maintainer().columns(&slots).unwrap();
        let mut worst: f64 = 0.0;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let scale = (expected[(i, i)] * expected[(j, j)]).abs().sqrt();
            let error = (got[(i, j)] - expected[(i, j)]).abs() / scale;
            worst = if error <= worst { worst } else { error };
        }
        worst
    }

    /// κ Σ w λλᵀ by its definition: each point in the element that it lies in.
    fn springs(&self, e: &Element) -> Matrix4<f64> {
        self.body.grip_matrix(e.tet).unwrap_or_else(Matrix4::zeros)
    }

    /// What a force and a torque do as the material moves is what they do on its mean and its turn.
    fn placement_is_dual_to_shares(&self) {
        let [_, mean, _] = self.body.grips() else { panic!("three grips") };
        let (force, torque) = (Vector3::new(0.3, -1.2, 0.7), Vector3::new(0.02, 0.05, -0.04));
        let mut loads = Loads::default();
        mean.add_shares(&force, &torque, &mut loads);
        let move_of = |x: &Vector3<f64>| 1e-2 * x.zxy() + 0.3 * x.component_mul(x);
        let moved: Vec<_> = self.positions.iter().map(|x| x + move_of(x)).collect();
        let pairs = loads.vertices().iter().zip(&self.positions);
        let work: f64 = pairs.map(|(f, x)| f.dot(&move_of(x))).sum();
        let [before, after] = [&self.positions, &moved].map(|x| mean.placement(x));
        let mut want = force.dot(&(after.0 - before.0));
        if mean.can_turn() {
            want += torque.dot(&(after.1 - before.1));
        }
        // The inertia's condition of up to 10⁸ (else it can't turn), rounded, over moves of 2 cm.
        let size: f64 = loads.vertices().iter().map(|f| f.norm()).sum();
        assert!((work - want).abs() < 1e-7 * size * 2e-2, "{work} {want}");
    }

    /// Σ over all elements of what their springs weigh: no point is lost or counted twice.
    fn total(&self) -> f64 {
        self.body.elements().iter().map(|e| self.springs(e).sum()).sum()
    }
}

fn element_of(
    forest: &BisectionForest,
    placement: &Placement,
    embedding: &Embedding,
    tet: &Tet,
) -> Element {
    Element {
        tet: tet.id,
        vertices: tet.vertices.map(VertexId::index),
        geometry: LinearTet::new(&tet.vertices.map(|v| placement.position(forest.point(v)))),
        elasticity: embedding.elasticity(tet.node),
    }
}

/// Points in a part of an organ of 2 × 1 × 1 cells, on a grid so that some lie on faces and edges.
fn points() -> impl Strategy<Value = Vec<WeightedPoint>> {
    let place = (0..12i32, 0..9i32, 0..9i32).prop_map(|(x, y, z)| {
        let origin = Vector3::new(0.01, -0.02, 0.005);
        let grid = Vector3::new(f64::from(x), f64::from(y), f64::from(z));
        origin + 1.25e-3 * grid
    });
    let point = (place, 1e-9..1e-8).prop_map(|(rest, weight)| WeightedPoint { rest, weight });
    proptest::collection::vec(point, 4..200)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Over 10³ splits and merges.
    #[test]
    fn splits_and_merges_change_nothing_that_is_felt(
        organ in organs([2, 1, 1], 3, 3.0..6.0, -0.5..0.45),
        points in points(),
        picks in proptest::collection::vec((proptest::bool::weighted(0.6), any::<Index>()), 100),
        element in prop_oneof![Just("p1"), Just("p1p1")],
    ) {
        let total: f64 = points.iter().map(|point| STIFFNESS * point.weight).sum();
        let mut gripped = Gripped::new(&organ, element, points);
        for (split, pick) in &picks {
            if *split { gripped.split(pick) } else { gripped.merge(pick) }
        }
        prop_assert!((gripped.total() - 2.0 * total).abs() <= 1e-11 * total);
        gripped.placement_is_dual_to_shares();
        // The body hangs on nothing but the pads.
        let error = gripped.error();
        prop_assert!(error < 1e-6, "{error:e}");
        // The second pad lets go: the first one's stiffness is left.
        let springs = gripped.body.grips_mut()[2].release();
        gripped.link.remove_springs(&springs, &elements(&gripped.body)).unwrap();
        prop_assert!((gripped.total() - total).abs() <= 1e-11 * total);
        let error = gripped.error();
        prop_assert!(error < 1e-6, "with one pad: {error:e}");
    }
}

/// A pad of one voxel between two halves of an edge: its matrix is that of its four weights.
#[test]
fn a_point_pulls_on_the_corners_around_it() {
    let organ = Organ::homogeneous([1, 1, 1], 1e4, 0.3);
    let rest = Vector3::new(0.01, -0.02, 0.005) + Vector3::new(2e-3, 3e-3, 4e-3);
    let points: Vec<WeightedPoint> = [[0.0; 3], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0]]
        .map(|x| WeightedPoint { rest: rest + Vector3::from(x), weight: 1e-8 })
        .to_vec();
    let gripped = Gripped::new(&organ, "p1", points.clone());
    let pad = &gripped.body.grips()[0];
    assert!((pad.centre() - (rest + Vector3::new(1e-3, 1e-3, 0.0) / 3.0)).norm() < 1e-15);
    assert!(pad.can_turn() && (pad.weight() - 3e-8).abs() < 1e-20);
    // At the pose itself nothing is felt; a millimetre off, κ w times that.
    let mut gripped = gripped;
    let there = *gripped.body.grips()[0].pose();
    for v in gripped.forest.vertices() {
        let x = gripped.placement.position(gripped.forest.point(v));
        gripped.positions[v.index()] = (there * nalgebra::Point3::from(x)).coords;
    }
    let felt = gripped.felt();
    assert!(felt.force.norm() < 1e-9 && felt.lack.amax() < 1e-15, "{felt:?}");
    gripped.positions.iter_mut().for_each(|x| x.x += 1e-3);
    let felt = gripped.felt();
    let want = -STIFFNESS * 3e-8 * 1e-3;
    assert!((felt.force - Vector3::new(want, 0.0, 0.0)).norm() < 1e-9, "{felt:?}");
    assert!((felt.energy - 0.5 * -want * 1e-3).abs() < 1e-9, "{felt:?}");
    assert!((felt.lack[0] + 1e-3).abs() < 1e-15);
}

/// The mean of two tetrahedra that are half a turn apart, but for little: as the body is turned, forces on it cancel
/// each other, and what is to answer to them would be thrown far away.
#[test]
fn what_is_led_is_not_thrown_away_where_rotations_cancel() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vector3::from);
    let apart = Vector3::new(3.0, 0.0, 0.0);
    let rest: Vec<_> = corners.iter().copied().chain(corners.map(|x| x + apart)).collect();
    let mut body = Body::new();
    for (tet, vertices) in [[0, 1, 2, 3], [4, 5, 6, 7]].into_iter().enumerate() {
        let geometry = LinearTet::new(&vertices.map(|v| rest[v]));
        let elasticity = isotropic(1e4, 0.3);
        body.insert(Element { tet: TetId(tet as u32), vertices, geometry, elasticity });
    }
    let inner = Vector3::repeat(0.25);
    let points = [inner, inner + apart].map(|rest| WeightedPoint { rest, weight: 1.0 });
    let mut grip =
        Grip::new(points.to_vec(), None, body.elements().iter(), &rest, |_, _| true).unwrap();
    let lead = Vector3::new(0.1, 0.2, 0.0);
    grip.set_pose(Isometry3::translation(lead.x, lead.y, lead.z));
    let answer = |f: &[f64], u: &mut [f64]| -> Result<(), ()> {
        u.copy_from_slice(f);
        Ok(())
    };
    let responses = grip.constraints_at_rest().answer(3, 24, answer).unwrap();
    let constraints = grip.constraints().with_responses(Arc::new(responses));
    let forces = forces_by_name("element").unwrap();
    for (turn, most) in [(0.0, 0.6), (PI - 1e-3, 0.9)] {
        let rotation = Rotation3::new(Vector3::z() * turn);
        let middle = inner + apart;
        let mut x = rest.clone();
        x[4..].iter_mut().for_each(|x| *x = middle + rotation * (*x - middle));
        let external = vec![Vector3::zeros(); x.len()];
        let (mut internal, mut residual) = (external.clone(), vec![0.0; 24]);
        let mut problem = Problem {
            body: &mut body,
            forces: forces.as_ref(),
            inertia: None,
            external: &external,
            free: &[true; 8],
            constraints: Some(&constraints),
            pushes: None,
            following: &[],
            inverse: &|_: &[f64], y: &mut [f64]| y.fill(f64::NAN),
        };
        problem.evaluate(&x, &mut internal, &mut residual, &Tolerance::new(1e-3, 1));
        let before = x.clone();
        problem.meet_constraints(&mut x);
        let farthest = x.iter().zip(&before).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(farthest < most, "{turn}: {farthest} m");
        assert!(constraints.lack(&x).amax() < 1e-12);
    }
}
