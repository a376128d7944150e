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
use crate::body::Body;
use crate::element::Element;
use crate::element::pressures::PressureTangent;
use crate::element::tetrahedron::stress_matrix;
use crate::field::Field;
use crate::forces::ElementTangent;
use crate::forces::tangent::convex_part;

/// x ← x + α K_t(x)⁻¹(f_ext − f_int(x)), K_t with the derivatives of the rotations, by sparse LU.
/// The reference: quadratic near the solution, for anisotropic D too (K_t is not symmetric then).
///
/// Where its step does not lead downhill, elements give the positive semi-definite part of their
/// tangents instead, by sparse LLᵀ. In a [mixed](crate::Body::mixed) body pressures are unknowns beside the
/// displacements, both matrices are factored by LU, and steps are halved until the next is shorter. Needs [`InternalForces::tangent`](crate::InternalForces::tangent); the
/// inverse of the [`Problem`] is not used. Cost: a sparse factorisation an iteration.
/// Source: Chao, Pinkall, Sanan, Schröder, A simple geometric model for elastic deformations, ACM
/// TOG 29(4), 2010; Teran et al., Robust quasistatic finite elements and flesh simulation, SCA
/// 2005 (the convex part).
#[derive(Clone, Copy, Debug, Default)]
pub struct Newton;

/// A whole step that leaves at most this part of the residual needs no line search.
const ENOUGH: f64 = 0.5;

/// Steps in which the residual of a mixed body has to fall by that part.
const PATIENCE: usize = 10;

/// How often a step is halved at most.
const HALVINGS: i32 = 8;

impl Equilibrium for Newton {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn needs_tangent(&self) -> bool {
        true
    }

    fn iterate(&mut self, problem: &mut Problem<'_>, point: &mut Iteration<'_>) {
        let mut sizes = vec![point.size];
        while point.goes_on() {
            point.begin_iteration();
            if !(exact_step(problem, point) || convex_step(problem, point)) {
                break;
            }
            point.keep_if_best(problem);
            sizes.push(point.size);
            // Without an energy to go down in it may never end.
            let before = sizes.len().checked_sub(1 + PATIENCE).map(|at| sizes[at]);
            let is_stuck = before.is_some_and(|before| point.size > ENOUGH * before);
            if is_stuck && problem.body.is_mixed() {
                break;
            }
        }
    }
}

/// True if the exact tangent gave a step that was taken.
fn exact_step(problem: &mut Problem<'_>, point: &mut Iteration<'_>) -> bool {
    let rows = Rows::new(problem);
    let Some(matrix) = rows.assemble(problem, point.positions, false) else {
        return false;
    };
    let Ok(factor) = matrix.sp_lu() else {
        return false;
    };
    if problem.body.is_mixed() {
        return shorten(problem, point, &rows, |rhs| factor.solve(rhs));
    }
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
    let rows = Rows::new(problem);
    let Some(matrix) = rows.assemble(problem, point.positions, true) else {
        return false;
    };
    if problem.body.is_mixed() {
        let Ok(factor) = matrix.sp_lu() else { return false };
        return shorten(problem, point, &rows, |rhs| factor.solve(rhs));
    }
    let Ok(factor) = matrix.sp_cholesky(Side::Lower) else {
        return false;
    };
    let step = rows.step(problem, &point.residual, |rhs| factor.solve(rhs));
    step.iter().all(|v| v.is_finite()) && search(problem, point, &step) > 0.0
}

/// Takes the longest of a mixed body's step, its half, … after which `solve`, the factor that it is from, asks
/// for less than it: the natural monotonicity test of Deuflhard (Newton Methods for Nonlinear Problems, 2004), in
/// which stiff parts do not count for more than soft ones. False if there is none.
fn shorten(
    problem: &mut Problem<'_>,
    point: &mut Iteration<'_>,
    rows: &Rows,
    solve: impl Fn(Mat<f64>) -> Mat<f64>,
) -> bool {
    let step = rows.step(problem, &point.residual, &solve);
    let size = dot(&step, &step).sqrt();
    if !size.is_finite() {
        return false;
    }
    let base = problem.iterate(point.positions);
    for halvings in 0..HALVINGS {
        let length = 0.5f64.powi(halvings);
        problem.return_to(&base, point.positions);
        point.advance(problem, &step, length);
        let next = rows.step(problem, &point.residual, &solve);
        if point.is_solved() || dot(&next, &next).sqrt() <= (1.0 - 0.5 * length) * size {
            return true;
        }
    }
    problem.return_to(&base, point.positions);
    point.evaluate(problem);
    false
}

/// Adds a matrix on the corners, the same for each axis.
fn add_alike(tangent: &mut ElementTangent, corners: &Matrix4<f64>) {
    for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
        (0..3).for_each(|axis| tangent[(3 * i + axis, 3 * j + axis)] += corners[(i, j)]);
    }
}

/// The unknowns of the problem, counted through: displacements of free vertices, pressures of all that
/// have elements.
struct Rows {
    /// By the problem's own row.
    of: Vec<usize>,
    /// The problem's row of each.
    at: Vec<usize>,
}

const HELD: usize = usize::MAX;

impl Rows {
    fn new(problem: &Problem<'_>) -> Self {
        let m = problem.unknowns_per_vertex();
        let is_unknown = |row: &usize| match row % m {
            3 => problem.body.pressure_row(row / m).1 > 0.0,
            _ => problem.free[row / m],
        };
        let at: Vec<usize> = (0..problem.rows()).filter(is_unknown).collect();
        let mut of = vec![HELD; problem.rows()];
        at.iter().enumerate().for_each(|(number, &row)| of[row] = number);
        Self { of, at }
    }

    /// The sum of the elements' tangents, or of their convex parts, in the units of a residual and a step
    /// of the problem; a unit diagonal where an unknown has no element. None without tangents.
    fn assemble(
        &self,
        problem: &Problem<'_>,
        positions: &Field,
        convex: bool,
    ) -> Option<SparseColMat<usize, f64>> {
        let (n, m) = (self.at.len(), problem.unknowns_per_vertex());
        let tangent_of = problem.forces.tangent()?;
        let mut triplets = Vec::with_capacity(144 * problem.body.elements().len());
        let mut touched = vec![false; n];
        let mut add = |row: usize, column: usize, value: f64| {
            let (row, column) = (self.of[row], self.of[column]);
            if row != HELD && column != HELD {
                touched[row] = true;
                triplets.push(Triplet::new(row, column, value));
            }
        };
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
            let at = |i: usize| m * element.vertices[i / 3] + i % 3;
            for (i, j) in (0..12).flat_map(|j| (0..12).map(move |i| (i, j))) {
                add(at(i), at(j), tangent[(i, j)]);
            }
            if let Some(pressed) = problem.body.pressure_tangent(number, positions) {
                add_pressures(problem.body, element, &pressed, &mut add);
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
        let m = problem.unknowns_per_vertex();
        let mut step = self.scatter(&solve(self.gather(residual)), residual.len());
        if let Some(constraints) = problem.constraints {
            let column = |row: &[(usize, Vector3<f64>)]| {
                let mut all = vec![0.0; residual.len()];
                for (v, g) in row {
                    (0..3).for_each(|axis| all[m * v + axis] += g[axis]);
                }
                self.scatter(&solve(self.gather(&all)), residual.len())
            };
            let columns = (0..constraints.len()).map(|k| column(constraints.row(k))).collect();
            constraints.answered_by(columns, m).correct(&mut step, m, None);
        }
        step
    }

    fn gather(&self, all: &[f64]) -> Mat<f64> {
        Mat::from_fn(self.at.len(), 1, |i, _| all[self.at[i]])
    }

    fn scatter(&self, rows: &Mat<f64>, length: usize) -> Vec<f64> {
        let mut all = vec![0.0; length];
        self.at.iter().enumerate().for_each(|(i, &at)| all[at] = rows[(i, 0)]);
        all
    }
}

/// Adds what an element's pressures and its dilation have to do with each other: rows [`Problem::evaluate`]'s
/// (P q − G u)/h with the sign of G u, columns h δq.
fn add_pressures(
    body: &Body,
    element: &Element,
    pressed: &PressureTangent,
    add: &mut impl FnMut(usize, usize, f64),
) {
    let Element { vertices, geometry, rotation, .. } = element;
    let pull = geometry.volume * rotation * stress_matrix(&pressed.pull);
    let weights = vertices.map(|v| body.pressure_row(v).1);
    let stiffening = body.stiffening();
    for (i, &v) in vertices.iter().enumerate() {
        let pressure = 4 * v + 3;
        for (gradient, &w) in geometry.gradients.iter().zip(vertices) {
            let force = weights[i] * (pull * gradient);
            let dilation = weights[i] * stiffening * pressed.quarter * (rotation * gradient);
            for axis in 0..3 {
                add(4 * w + axis, pressure, force[axis]);
                add(pressure, 4 * w + axis, dilation[axis]);
            }
        }
        for (j, &w) in vertices.iter().enumerate() {
            let own = if i == j { pressed.own } else { 0.0 };
            let entry = weights[i] * weights[j] * stiffening * (pressed.across + own);
            add(pressure, 4 * w + 3, -entry);
        }
    }
}
