//! `newton`: the exact tangent, factored at every iteration.

use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use nalgebra::{Matrix4, Vector3};

use super::iteration::Iteration;
use super::line_search::search;
use super::problem::Problem;
use super::solver::Equilibrium;
use super::vectors::dot;
use crate::field::Field;
use crate::forces::ElementTangent;
use crate::forces::tangent::convex_part;

/// x ← x + α K_t(x)⁻¹(f_ext − f_int(x)), K_t with the derivatives of the rotations, by sparse LU.
/// The reference: quadratic near the solution, for anisotropic D too (K_t is not symmetric then).
///
/// Where its step does not lead downhill, elements give the positive semi-definite part of their
/// tangents instead, by sparse LLᵀ. Needs [`InternalForces::tangent`](crate::InternalForces::tangent); the
/// inverse of the [`Problem`] is not used. Cost: a sparse factorisation an iteration.
/// Source: Chao, Pinkall, Sanan, Schröder, A simple geometric model for elastic deformations, ACM
/// TOG 29(4), 2010; Teran et al., Robust quasistatic finite elements and flesh simulation, SCA
/// 2005 (the convex part).
#[derive(Clone, Copy, Debug, Default)]
pub struct Newton;

/// A whole step that leaves at most this part of the residual needs no line search.
const ENOUGH: f64 = 0.5;

impl Equilibrium for Newton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn needs_tangent(&self) -> bool {
        true
    }

    fn needs_definite(&self) -> bool {
        true
    }

    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        if problem.body.is_mixed() {
            return;
        }
        while point.goes_on() {
            point.begin_iteration();
            if !(exact_step(problem, point) || convex_step(problem, point)) {
                break;
            }
            point.keep_if_best(problem);
        }
    }
}

/// True if the exact tangent gave a step that was taken.
fn exact_step(problem: &mut Problem<'_>, point: &mut Iteration<'_>) -> bool {
    let rows = Rows::new(problem.free);
    let Some(matrix) = rows.assemble(problem, point.positions, false) else {
        return false;
    };
    let Ok(factor) = matrix.sp_lu() else {
        return false;
    };
    let step = rows.step(problem, &point.residual, |rhs| factor.solve(rhs));
    if !step.iter().all(|v| v.is_finite()) || !(dot(&point.residual, &step) > 0.0) {
        return false;
    }
    let (before, base) = (point.size, point.positions.to_vec());
    point.advance(problem, &step, 1.0);
    if point.size <= ENOUGH * before {
        return true;
    }
    point.positions.copy_from_slice(&base);
    point.evaluate(problem);
    search(problem, point, &step) > 0.0
}

/// True if the convex part of the tangent gave a step that was taken.
fn convex_step(problem: &mut Problem<'_>, point: &mut Iteration<'_>) -> bool {
    let rows = Rows::new(problem.free);
    let Some(matrix) = rows.assemble(problem, point.positions, true) else {
        return false;
    };
    let Ok(factor) = matrix.sp_cholesky(Side::Lower) else {
        return false;
    };
    let step = rows.step(problem, &point.residual, |rhs| factor.solve(rhs));
    step.iter().all(|v| v.is_finite()) && search(problem, point, &step) > 0.0
}

/// Adds a matrix on the corners, the same for each axis.
fn add_alike(tangent: &mut ElementTangent, corners: &Matrix4<f64>) {
    for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
        (0..3).for_each(|axis| tangent[(3 * i + axis, 3 * j + axis)] += corners[(i, j)]);
    }
}

/// The rows of the free vertices, counted through.
struct Rows {
    of_vertex: Vec<usize>,
    vertices: Vec<usize>,
}

const HELD: usize = usize::MAX;

impl Rows {
    fn new(free: &[bool]) -> Self {
        let vertices: Vec<usize> = (0..free.len()).filter(|&v| free[v]).collect();
        let mut of_vertex = vec![HELD; free.len()];
        vertices.iter().enumerate().for_each(|(row, &v)| of_vertex[v] = 3 * row);
        Self { of_vertex, vertices }
    }

    /// The sum of the elements' tangents, or of their convex parts; a unit diagonal where a free
    /// vertex has no element. None without tangents.
    fn assemble(
        &self,
        problem: &Problem<'_>,
        positions: &Field,
        convex: bool,
    ) -> Option<SparseColMat<usize, f64>> {
        let (n, tangent_of) = (3 * self.vertices.len(), problem.forces.tangent()?);
        let mut triplets = Vec::with_capacity(144 * problem.body.elements().len());
        let mut touched = vec![false; n];
        for (number, element) in problem.body.elements().iter().enumerate() {
            let mut tangent = tangent_of(problem.body, number, positions);
            if let Some(inertia) = problem.inertia {
                add_alike(&mut tangent, &inertia.matrix(number));
            }
            if convex {
                tangent = convex_part(&tangent);
            }
            if let Some(held) = problem.body.grip_matrix(element.tet) {
                add_alike(&mut tangent, &held);
            }
            let at = element.vertices.map(|v| self.of_vertex[v]);
            for (i, j) in (0..12).flat_map(|j| (0..12).map(move |i| (i, j))) {
                if at[i / 3] != HELD && at[j / 3] != HELD {
                    let (row, column) = (at[i / 3] + i % 3, at[j / 3] + j % 3);
                    touched[row] = true;
                    triplets.push(Triplet::new(row, column, tangent[(i, j)]));
                }
            }
        }
        let alone = (0..n).filter(|&row| !touched[row]);
        triplets.extend(alone.map(|row| Triplet::new(row, row, 1.0)));
        SparseColMat::try_new_from_triplets(n, n, &triplets).ok()
    }

    /// K_t⁻¹ r, `solve` is of K_t; under constraints with their multipliers as further unknowns.
    fn step(
        &self,
        problem: &Problem<'_>,
        residual: &[f64],
        solve: impl Fn(Mat<f64>) -> Mat<f64>,
    ) -> Vec<f64> {
        let mut step = self.scatter(&solve(self.gather(residual)), residual.len());
        if let Some(constraints) = problem.constraints {
            let column = |row: &[(usize, Vector3<f64>)]| {
                let mut all = vec![0.0; residual.len()];
                for (v, g) in row {
                    (0..3).for_each(|axis| all[3 * v + axis] += g[axis]);
                }
                self.scatter(&solve(self.gather(&all)), residual.len())
            };
            let columns = (0..constraints.len()).map(|k| column(constraints.row(k))).collect();
            constraints.answered_by(columns, 3).correct(&mut step, 3, None);
        }
        step
    }

    fn gather(&self, all: &[f64]) -> Mat<f64> {
        Mat::from_fn(3 * self.vertices.len(), 1, |i, _| all[3 * self.vertices[i / 3] + i % 3])
    }

    fn scatter(&self, rows: &Mat<f64>, length: usize) -> Vec<f64> {
        let mut all = vec![0.0; length];
        for (row, &v) in self.vertices.iter().enumerate() {
            (0..3).for_each(|axis| all[3 * v + axis] = rows[(3 * row + axis, 0)]);
        }
        all
    }
}
