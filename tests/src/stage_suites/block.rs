//! A block of one isotropic material, some tetrahedra large.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_corot::{Body, InternalForces, law_by_name};

use crate::organ::{Organ, elements};

/// E, Pa, and ν.
const MATERIAL: (f64, f64) = (1e4, 0.3);

/// The most tetrahedra around a vertex of the meshes here, times the twelve products of a row.
const SUMMANDS: f64 = 24.0 * 12.0;

/// Positions of all vertices, m.
pub type Positions = Vec<Vector3<f64>>;

/// `body`, still empty, as a block of 2 × 1 × 1 cells of 1 cm, and its positions at rest.
pub fn block(mut body: Body) -> (Body, Positions) {
    let organ = Organ::homogeneous([2, 1, 1], MATERIAL.0, MATERIAL.1);
    let (forest, placement) = (organ.forest(2, 4), organ.placement(4));
    let embedding = organ.embedding("laminate");
    elements(&forest, &placement, &embedding).for_each(|element| body.insert(element));
    let mut rest = vec![Vector3::zeros(); forest.vertex_capacity()];
    forest.vertices().for_each(|v| rest[v.index()] = placement.position(forest.point(v)));
    (body, rest)
}

/// The same under a law in a step of 0.1 s.
pub fn block_under(law: &str, body: Body) -> (Body, Positions) {
    let law: Arc<_> = law_by_name(law, 0.05).unwrap().into();
    let (mut body, rest) = block(body.with_law(law));
    body.begin_step(0.1);
    (body, rest)
}

/// The corners of one tetrahedron, none of whose edges lies along an axis, m.
pub fn askew() -> [Vector3<f64>; 4] {
    let corners =
        [[0.0, 0.0, 0.0], [0.02, 0.003, 0.001], [0.002, 0.018, -0.004], [0.005, 0.004, 0.02]];
    corners.map(Vector3::from)
}

/// A direction for every vertex, of the size of a cell, without any symmetry.
pub fn waves(count: usize) -> Positions {
    let wave = |i: usize, axis: usize| 0.01 * (1.7 * i as f64 + 2.9 * axis as f64 + 0.4).sin();
    (0..count).map(|i| Vector3::from_fn(|axis, _| wave(i, axis))).collect()
}

/// x + s d.
pub fn moved(x: &[Vector3<f64>], s: f64, d: &[Vector3<f64>]) -> Positions {
    x.iter().zip(d).map(|(x, d)| x + s * d).collect()
}

/// √Σ ‖a‖².
pub fn norm(a: &[Vector3<f64>]) -> f64 {
    a.iter().map(Vector3::norm_squared).sum::<f64>().sqrt()
}

/// The forces at `x`.
pub fn forces(stage: &dyn InternalForces, body: &mut Body, x: &[Vector3<f64>]) -> Positions {
    let mut forces = vec![Vector3::repeat(f64::NAN); x.len()];
    stage.internal_forces(body, x, &mut forces);
    forces
}

/// What rounding of positions may do to forces: c ε ‖K‖ ‖x‖, N.
pub fn rounding(stage: &dyn InternalForces, body: &Body, x: &[Vector3<f64>]) -> f64 {
    SUMMANDS * f64::EPSILON * stage.stiffness_scale(body) * norm(x)
}
