//! How an equilibrium answers to a small change, by the tangent that it has there.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::problem::{Problem, Tolerance};
use super::tangent_system::{Kind, TangentSystem};
use crate::body::Body;
use crate::element::ElementPoint;
use crate::field::Field;
use crate::vectors::{axpy, dot};

/// What holds a body besides its supports, with forces that turn as it moves.
#[derive(Clone, Debug, Default)]
pub struct Attached {
    /// Rows of G, each by vertex: Σ g · δx is what a response is told it is.
    pub rows: Vec<Vec<(usize, Vector3<f64>)>>,
    /// Points with a stiffness of their own, N/m, symmetric and of either sign: −λ times the curvature of an obstacle
    /// that pushes with λ.
    pub points: Vec<(ElementPoint, Matrix3<f64>)>,
}

/// What disturbs an equilibrium, all of it small.
#[derive(Clone, Copy, Debug)]
pub struct Disturbance<'a> {
    /// Forces, in the rows of residuals, N.
    pub load: &'a [f64],
    /// How far vertices go that are not free, in the rows of steps, m; zero on all others.
    pub moved: &'a [f64],
    /// G δx, m.
    pub targets: &'a [f64],
}

/// Steps of difference, as a part of the smallest element's size: the error of a central one is of its square, that of
/// rounding goes with its inverse.
const STEP: f64 = 1e-5;

/// What of a disturbance may be left.
const LEFT: f64 = 1e-10;

/// What may be left where rounding allows no less.
const ENOUGH: f64 = 1e-6;

/// Directions at most by the warped inverse, and by a factor of the tangent.
const FEW: usize = 80;
const MANY: usize = 200;

/// A direction that adds less than this part of itself to those before it adds rounding.
const SINGULAR: f64 = 1e-13;

/// Combinations of rows of G that the linear body answers to by less than this part of the most are left to the others.
const DEPENDENT: f64 = 1e-10;

impl Problem<'_> {
    /// d, in the rows of steps: A d = load + Gᵀμ on the free vertices with G d = targets, A = −∂r/∂x the exact tangent, r
    /// f_ext − f_int where the body is at `positions` in equilibrium. d is what positions and pressures
    /// change by, to first order in the disturbance. As A is symmetric without loads that follow the body, it is an adjoint
    /// state too.
    ///
    /// Constraints of the problem itself and obstacles that push in it are not looked at: they belong into `attached`. None
    /// if it is not found, as where A is singular.
    ///
    /// Cost: two evaluations of internal forces and an application of the inverse for each of some tens of directions, and
    /// an application for each row of G; where that does not arrive, a factor of the tangent of forces that have one.
    /// # Source
    /// Saad, Schultz, GMRES, SIAM J. Sci. Stat. Comput. 7(3), 1986; A d by central differences as of Knoll, Keyes,
    /// Jacobian-free Newton-Krylov methods, J. Comput. Phys. 193(2), 2004.
    pub fn respond(
        &self,
        positions: &Field,
        attached: &Attached,
        disturbance: &Disturbance<'_>,
    ) -> Option<Vec<f64>> {
        let warped = |force: &[f64]| self.warped(force);
        let found = self.respond_by(&warped, FEW, positions, attached, disturbance);
        if found.is_some() || self.forces.tangent().is_none() {
            return found;
        }
        let mut system = TangentSystem::new(self, Kind::Whole, None);
        system.renew(self, positions)?;
        let solved = |force: &[f64]| system.solve(force);
        self.respond_by(&solved, MANY, positions, attached, disturbance)
    }

    /// The same with something that comes near to A⁻¹, in at most so many directions.
    fn respond_by(
        &self,
        near_inverse: &dyn Fn(&[f64]) -> Vec<f64>,
        directions: usize,
        positions: &Field,
        attached: &Attached,
        disturbance: &Disturbance<'_>,
    ) -> Option<Vec<f64>> {
        let Disturbance { load, moved, targets } = *disturbance;
        let held = Columns::new(self, &attached.rows, near_inverse)?;
        let mut answer = moved.to_vec();
        held.correct(&mut answer, targets);
        // The rotations that evaluations leave in it are not those of the preconditioner.
        let mut aside = self.body.clone();
        let mut rest = self.pulled(&mut aside, positions, attached, &answer);
        rest.iter_mut().zip(load).for_each(|(rest, load)| *rest = load - *rest);
        let prepared = |force: &[f64]| {
            let mut step = near_inverse(force);
            held.correct(&mut step, &vec![0.0; targets.len()]);
            step
        };
        let start = prepared(&rest);
        let size = dot(&start, &start).sqrt();
        let whole = size.max(LEFT * dot(&answer, &answer).sqrt());
        if !(whole > 0.0) {
            return (whole == 0.0).then_some(answer);
        }
        let operator = |d: &[f64]| prepared(&self.pulled(&mut aside, positions, attached, d));
        let (found, left) = least_residual(&start, LEFT * whole, directions, operator);
        axpy(1.0, &found, &mut answer);
        (left <= ENOUGH * whole).then_some(answer)
    }

    /// A d on the free vertices, in the rows of residuals, by a copy of the body.
    fn pulled(
        &self,
        body: &mut Body,
        positions: &Field,
        attached: &Attached,
        d: &[f64],
    ) -> Vec<f64> {
        let mut pull = vec![0.0; d.len()];
        let farthest = d.iter().fold(0.0, |most: f64, d| most.max(d.abs()));
        if farthest == 0.0 {
            return pull;
        }
        let volumes = self.body.elements().iter().map(|element| element.geometry.volume);
        let length = STEP * volumes.fold(f64::INFINITY, f64::min).cbrt() / farthest;
        let mut internal = vec![Vector3::zeros(); positions.len()];
        for sign in [-1.0, 1.0] {
            let mut residual = vec![0.0; d.len()];
            let mut moved = positions.to_vec();
            body.set_pressures(&self.body.pressures());
            let mut aside = self.with_body(body);
            (aside.constraints, aside.pushes) = (None, None);
            aside.advance(&mut moved, d, sign * length);
            aside.evaluate(&moved, &mut internal, &mut residual, &Tolerance::new(1.0, 0));
            axpy(-sign / (2.0 * length), &residual, &mut pull);
        }
        let m = self.unknowns_per_vertex();
        for (point, stiffness) in &attached.points {
            let corners = || point.vertices.iter().zip(point.weights);
            let moves = |(v, weight): (&usize, f64)| {
                weight * Vector3::from_column_slice(&d[m * v..m * v + 3])
            };
            let force = stiffness * corners().map(moves).sum::<Vector3<f64>>();
            for (&v, weight) in corners().filter(|(v, _)| self.free[**v]) {
                (0..3).for_each(|axis| pull[m * v + axis] += weight * force[axis]);
            }
        }
        pull
    }

    /// T C Tᵀ of forces.
    fn warped(&self, force: &[f64]) -> Vec<f64> {
        let mut step = force.to_vec();
        self.body.turn_back(&mut step);
        let turned = step.clone();
        self.inverse.apply(&turned, &mut step);
        self.body.turn(&mut step);
        step
    }
}

/// What the body answers to the rows of G, nearly.
struct Columns<'a> {
    rows: &'a [Vec<(usize, Vector3<f64>)>],
    unknowns: usize,
    columns: Vec<Vec<f64>>,
    /// (G C Gᵀ)⁺: points closer together than the mesh resolves depend on each other.
    inverse: DMatrix<f64>,
}

impl<'a> Columns<'a> {
    /// None where the answer of the linear body is not finite.
    fn new(
        problem: &Problem<'_>,
        rows: &'a [Vec<(usize, Vector3<f64>)>],
        near_inverse: &dyn Fn(&[f64]) -> Vec<f64>,
    ) -> Option<Self> {
        let unknowns = problem.unknowns_per_vertex();
        let columns: Vec<Vec<f64>> =
            rows.iter().map(|row| near_inverse(&problem.force_of(row))).collect();
        let entry = |i: usize, j: usize| along(&rows[i], &columns[j], unknowns);
        let block = DMatrix::from_fn(rows.len(), rows.len(), entry);
        let least = DEPENDENT * block.amax();
        let inverse = match rows.is_empty() {
            true => block,
            false => block.try_svd(true, true, f64::EPSILON, 0)?.pseudo_inverse(least).ok()?,
        };
        Some(Self { rows, unknowns, columns, inverse })
    }

    /// Moves `step` to where G step = `targets`.
    fn correct(&self, step: &mut [f64], targets: &[f64]) {
        if self.rows.is_empty() {
            return;
        }
        let lack =
            self.rows.iter().zip(targets).map(|(row, to)| to - along(row, step, self.unknowns));
        let lack = DVector::from_iterator(self.rows.len(), lack);
        let weights = &self.inverse * lack;
        self.columns.iter().zip(weights.iter()).for_each(|(c, weight)| axpy(*weight, c, step));
    }
}

/// Σ g · d of a row of G.
fn along(row: &[(usize, Vector3<f64>)], d: &[f64], unknowns: usize) -> f64 {
    let of = |(v, g): &(usize, Vector3<f64>)| {
        g.dot(&Vector3::from_column_slice(&d[unknowns * v..unknowns * v + 3]))
    };
    row.iter().map(of).sum()
}

/// The combination d of so many directions from `start` with the least ‖start − B d‖, until that is below `enough`; also what is left.
fn least_residual(
    start: &[f64],
    enough: f64,
    directions: usize,
    mut operator: impl FnMut(&[f64]) -> Vec<f64>,
) -> (Vec<f64>, f64) {
    let size = |a: &[f64]| dot(a, a).sqrt();
    let scaled = |a: &[f64], by: f64| a.iter().map(|a| by * a).collect::<Vec<f64>>();
    let mut left = size(start);
    let mut basis = vec![scaled(start, 1.0 / left)];
    // R of the Hessenberg matrix, by columns, its rotations, and what they make of the right side.
    let (mut columns, mut turns, mut side) = (Vec::new(), Vec::<[f64; 2]>::new(), vec![left]);
    while left > enough && columns.len() < directions {
        let mut next = operator(&basis[basis.len() - 1]);
        let before = size(&next);
        let mut column = vec![0.0; basis.len()];
        // Once more for what rounding has left.
        for _ in 0..2 {
            for (entry, one) in column.iter_mut().zip(&basis) {
                let part = dot(one, &next);
                *entry += part;
                axpy(-part, one, &mut next);
            }
        }
        let beyond = size(&next);
        for (i, [c, s]) in turns.iter().enumerate() {
            let [a, b] = [column[i], column[i + 1]];
            (column[i], column[i + 1]) = (c * a + s * b, c * b - s * a);
        }
        let at = column.len() - 1;
        let length = column[at].hypot(beyond);
        if !(length > SINGULAR * before) {
            break;
        }
        let [c, s] = [column[at] / length, beyond / length];
        column[at] = length;
        columns.push(column);
        turns.push([c, s]);
        let last = side[at];
        side[at] = c * last;
        side.push(-s * last);
        left = side[at + 1].abs();
        if !(beyond > SINGULAR * before) {
            break;
        }
        basis.push(scaled(&next, 1.0 / beyond));
    }
    let mut weights = vec![0.0; columns.len()];
    for i in (0..columns.len()).rev() {
        let known: f64 = (i + 1..columns.len()).map(|j| columns[j][i] * weights[j]).sum();
        weights[i] = (side[i] - known) / columns[i][i];
    }
    let mut sum = vec![0.0; start.len()];
    basis.iter().zip(&weights).for_each(|(one, weight)| axpy(*weight, one, &mut sum));
    (sum, left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_of_no_symmetry_is_solved_within_its_rank() {
        let matrix = DMatrix::from_fn(7, 7, |i, j| {
            if i == j { 3.0 + i as f64 } else { ((3 * i + 5 * j) % 7) as f64 * 0.3 - 1.0 }
        });
        let wanted = DVector::from_fn(7, |i, _| (i as f64 - 2.5).powi(3));
        let side = &matrix * &wanted;
        let (found, left) = least_residual(side.as_slice(), 1e-12, 20, |d| {
            (&matrix * DVector::from_column_slice(d)).as_slice().to_vec()
        });
        let off = (DVector::from_vec(found) - &wanted).norm();
        assert!(off < 1e-11 * wanted.norm() && left <= 1e-12, "{off:.1e} {left:.1e}");
    }
}
