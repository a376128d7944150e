//! Which points of a body may touch what, and what a solve with contact ends in.

use nalgebra::{Matrix3, Vector3};

use super::obstacle::Obstacle;
use crate::element::ElementPoint;
use crate::equilibrium::{Outcome, Problem};
use crate::field::Field;

/// Which points may touch what, and the compliance of the body there.
pub struct Contact<'a> {
    /// The points with the position of their obstacle in `obstacles`.
    pub points: &'a [(ElementPoint, usize)],
    /// The obstacles, which stay where they are during the solve.
    pub obstacles: &'a [&'a dyn Obstacle],
    /// n Ĉ nᵀ of all pairs of `points` by rows, m/N, from a solve before, and the normals that it is
    /// for; it is computed anew where there is none, or a normal has turned.
    ///
    /// It shapes the iteration alone; what it converges to is the same for another one.
    pub known: Option<(&'a [f64], &'a [Vector3<f64>])>,
    /// How deep a point may be inside its obstacle, or how far from it while pushed, m; > 0.
    pub depth: f64,
}

/// How a solve with contact ended.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactOutcome {
    /// Iterations, residual (the contact forces are among the loads), convergence.
    pub outcome: Outcome,
    /// λ ≥ 0 of each point, N: its obstacle pushes it with λ n.
    pub multipliers: Vec<f64>,
    /// n of each point, away from its obstacle.
    pub normals: Vec<Vector3<f64>>,
    /// n Ĉ nᵀ of all pairs of points by rows, m/N; empty where no iteration needed one.
    pub compliance: Vec<f64>,
    /// The normals that it is for.
    pub shaped: Vec<Vector3<f64>>,
    /// The deepest penetration, m; 0 without one.
    pub penetration: f64,
}

impl Contact<'_> {
    /// W = G T C Tᵀ Gᵀ, k × k by rows, m/N, with constraints kept.
    pub(super) fn compliance(&self, normals: &Field, problem: &Problem<'_>) -> Vec<f64> {
        let m = problem.unknowns_per_vertex();
        let rotations = problem.body.vertex_rotations();
        let load = |((point, _), normal): (&(ElementPoint, usize), &Vector3<f64>)| {
            let corners = point.vertices.into_iter().zip(point.weights);
            let free = corners.filter(|(v, _)| problem.free[*v]);
            let pulls = free.flat_map(|(v, weight)| {
                let turn = rotations.get(v).copied().unwrap_or_else(Matrix3::identity);
                let pull = turn.tr_mul(normal) * weight;
                (0..3).map(move |axis| (m * v + axis, pull[axis]))
            });
            pulls.collect()
        };
        let loads: Vec<Vec<(usize, f64)>> = self.points.iter().zip(normals).map(load).collect();
        let mut w = problem.inverse.compliance(problem.rows(), &loads);
        if let Some(constraints) = problem.constraints {
            let less = constraints.stiffening(&loads);
            w.iter_mut().zip(less.transpose().iter()).for_each(|(w, less)| *w -= less);
        }
        w
    }
}
