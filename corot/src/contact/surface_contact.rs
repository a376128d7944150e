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
    /// Vertex numbers, ascending, of the rows of `compliance`: all corners of `points` that move.
    pub vertices: &'a [usize],
    /// C_pp of the unrotated body on `vertices`, x, y, z each, by rows (it is symmetric), m/N.
    ///
    /// It shapes the iteration alone; what it converges to is the same for another one.
    pub compliance: &'a [f64],
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
    /// n Ĉ nᵀ of all pairs of points by rows, m/N, at the last iteration; empty without one.
    pub compliance: Vec<f64>,
    /// The deepest penetration, m; 0 without one.
    pub penetration: f64,
}

impl Contact<'_> {
    /// W = G T C_pp Tᵀ Gᵀ, k × k by rows, m/N.
    pub(super) fn compliance(&self, normals: &Field, problem: &Problem<'_>) -> Vec<f64> {
        let (k, rows) = (self.points.len(), 3 * self.vertices.len());
        let rotations = problem.body.vertex_rotations();
        // Per point and corner: the row of its vertex and w Tᵀ n.
        let pulls: Vec<[(Option<usize>, Vector3<f64>); 4]> = (0..k)
            .map(|i| {
                let point = &self.points[i].0;
                std::array::from_fn(|a| {
                    let v = point.vertices[a];
                    let turned = rotations.get(v).unwrap_or(&Matrix3::identity()).transpose();
                    let row = self.vertices.binary_search(&v).ok().filter(|_| problem.free[v]);
                    (row, turned * normals[i] * point.weights[a])
                })
            })
            .collect();
        let mut w = vec![0.0; k * k];
        let mut column = vec![0.0; rows];
        for j in 0..k {
            column.fill(0.0);
            for (row, pull) in &pulls[j] {
                let Some(row) = row else { continue };
                for axis in 0..3 {
                    let at = rows * (3 * row + axis);
                    for (c, e) in column.iter_mut().zip(&self.compliance[at..at + rows]) {
                        *c += pull[axis] * e;
                    }
                }
            }
            for i in j..k {
                let give: f64 = pulls[i]
                    .iter()
                    .filter_map(|(row, pull)| {
                        let at = 3 * (*row)?;
                        Some(pull.dot(&Vector3::from_column_slice(&column[at..at + 3])))
                    })
                    .sum();
                w[k * i + j] = give;
                w[k * j + i] = give;
            }
        }
        w
    }
}
