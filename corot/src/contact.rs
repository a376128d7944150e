//! Equilibrium in the way of obstacles: they push, and never pull.

mod in_turn;
mod together;

use nalgebra::{Matrix3, Vector3};

use crate::equilibrium::{Equilibrium, Iterate, Outcome, Problem, Tolerance};
use crate::gauss_seidel::projected_gauss_seidel;
use crate::obstacle::Obstacle;

/// A point of a body's surface: x = Σ w_i x_i over the corners of its coarse tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Corners, vertex numbers.
    pub vertices: [usize; 4],
    /// Barycentric weights, of sum 1.
    pub weights: [f64; 4],
}

impl SurfacePoint {
    /// Where it is when the vertices are at `positions`.
    pub fn position(&self, positions: &[Vector3<f64>]) -> Vector3<f64> {
        (0..4).map(|i| self.weights[i] * positions[self.vertices[i]]).sum()
    }
}

/// Which points may touch what, and what the body gives way there.
pub struct Contact<'a> {
    /// The points with the position of their obstacle in `obstacles`.
    pub points: &'a [(SurfacePoint, usize)],
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

/// Sweeps of an iteration at most: it need not be exact, the next one goes on from there.
const SWEEPS: usize = 60;

/// Finds x and λ with f_int(x) = f_ext + Σ λ_i n_i w_i, gap_i(x) ≥ 0, λ_i ≥ 0 and λ_i gap_i = 0.
///
/// With Ĉ = T C Tᵀ, G the gaps' gradients, r the residual and h the gaps, an iteration solves
/// 0 ≤ λ' ⊥ h + G Ĉ r + G Ĉ Gᵀ(λ' − λ) ≥ 0 and steps to x + Ĉ(r + Gᵀ(λ' − λ)) and λ', both mixed as
/// in [`Anderson`](crate::Anderson): at a fixed point r = 0 and the conditions hold, whatever Ĉ is.
/// `multipliers` begin it (those of the last solve, or zeros; one per point). It has converged when
/// the relative residual is at most `tolerance.residual` and no point is deeper than
/// `contact.depth` or pushed from farther away.
///
/// Mixing is for smooth maps: its memory goes when a point comes in or goes out. Where that happens
/// again and again the set of points that push is settled first, with forces of either sign on them
/// and none on the others, and renewed by the signs of forces and gaps in its solution. Where this
/// iteration gives up, `equilibrium` solves under contact forces that stay as they are, and between
/// its solves they follow the gaps, 0 ≤ λ' ⊥ h + G Ĉ Gᵀ(λ' − λ) ≥ 0; [`Outcome::fallbacks`] then
/// counts it.
///
/// Cost: two applications of the inverse and a force evaluation an iteration, and O(k² + k v) for k
/// points of v vertices. On return `internal` holds the internal forces.
/// # Source
/// Duriez, Dubois, Kheddar, Andriot, Realistic haptic rendering of interacting deformable objects
/// in virtual environments, IEEE TVCG 12(1), 2006 (compliance at the contacts, Gauss-Seidel).
pub fn solve_with_contact(
    problem: &mut Problem<'_>,
    equilibrium: &mut dyn Equilibrium,
    contact: &Contact<'_>,
    multipliers: &[f64],
    positions: &mut [Vector3<f64>],
    internal: &mut [Vector3<f64>],
    tolerance: &Tolerance,
) -> ContactOutcome {
    let mut run = Run::new(problem, contact, multipliers, internal, tolerance);
    run.evaluate(positions);
    let start = (run.merit(), run.problem.iterate(positions), run.lambda.clone());
    if !run.together(&start, positions) {
        run.return_to(&start, positions);
        run.in_turn(equilibrium, positions);
    }
    run.outcome()
}

/// Merit, where the body stands, and λ.
type Place = (f64, Iterate, Vec<f64>);

/// A solve under way.
struct Run<'a, 'b, 'p> {
    problem: &'a mut Problem<'p>,
    contact: &'a Contact<'b>,
    internal: &'a mut [Vector3<f64>],
    tolerance: &'a Tolerance,
    lambda: Vec<f64>,
    /// Which points push, where that is settled for now: with a force of either sign, and no other.
    set: Option<Vec<bool>>,
    gaps: Vec<f64>,
    normals: Vec<Vector3<f64>>,
    /// Loads with the contact forces.
    loads: Vec<Vector3<f64>>,
    residual: Vec<f64>,
    scratch: Vec<f64>,
    push: Vec<f64>,
    compliance: Vec<f64>,
    size: f64,
    iterations: usize,
    evaluations: usize,
    fallbacks: usize,
}

impl<'a, 'b, 'p> Run<'a, 'b, 'p> {
    fn new(
        problem: &'a mut Problem<'p>,
        contact: &'a Contact<'b>,
        multipliers: &[f64],
        internal: &'a mut [Vector3<f64>],
        tolerance: &'a Tolerance,
    ) -> Self {
        let (n, k) = (problem.rows(), contact.points.len());
        let mut lambda = multipliers.to_vec();
        lambda.resize(k, 0.0);
        Self {
            loads: problem.external.to_vec(),
            residual: vec![0.0; n],
            scratch: vec![0.0; n],
            push: vec![0.0; n],
            set: None,
            gaps: vec![0.0; k],
            normals: vec![Vector3::zeros(); k],
            compliance: Vec::new(),
            size: f64::NAN,
            iterations: 0,
            evaluations: 0,
            fallbacks: 0,
            problem,
            contact,
            internal,
            tolerance,
            lambda,
        }
    }

    /// Renews gaps, normals, loads, forces and residual where the positions are.
    fn evaluate(&mut self, positions: &[Vector3<f64>]) {
        self.loads.copy_from_slice(self.problem.external);
        for (i, (point, obstacle)) in self.contact.points.iter().enumerate() {
            let at = point.position(positions);
            (self.gaps[i], self.normals[i]) = self.contact.obstacles[*obstacle].gap(&at);
            for (v, weight) in point.vertices.iter().zip(point.weights) {
                self.loads[*v] += self.normals[i] * (self.lambda[i] * weight);
            }
        }
        let mut loaded = self.problem.with_loads(&self.loads);
        self.size = loaded.evaluate(positions, self.internal, &mut self.residual, self.tolerance);
        self.evaluations += 1;
    }

    /// How far from converged, at most 1 when it is: the residual and what is deeper or farther
    /// than allowed, each in units of its limit.
    fn merit(&self) -> f64 {
        if self.lambda.iter().any(|&force| force < 0.0) {
            return f64::INFINITY;
        }
        self.merit_with(self.gaps.iter().zip(&self.lambda).map(|(gap, lambda)| {
            let far = if *lambda > 0.0 { *gap } else { 0.0 };
            (-gap).max(far)
        }))
    }

    fn merit_with(&self, off: impl Iterator<Item = f64>) -> f64 {
        // A NaN must stay one.
        off.fold(self.size / self.tolerance.residual, |merit, off| {
            if off / self.contact.depth <= merit { merit } else { off / self.contact.depth }
        })
    }

    fn return_to(&mut self, best: &Place, positions: &mut [Vector3<f64>]) {
        self.problem.return_to(&best.1, positions);
        self.lambda.copy_from_slice(&best.2);
        self.evaluate(positions);
    }

    /// λ' with 0 ≤ λ' ⊥ h + G moves + W(λ' − λ) ≥ 0; renews W.
    fn forces_by_gaps(&mut self, moves: &[f64]) -> Vec<f64> {
        let k = self.lambda.len();
        self.compliance = self.contact.compliance(&self.normals, self.problem);
        let m = self.problem.unknowns_per_vertex();
        let mut slack = self.gaps.clone();
        for (i, (point, _)) in self.contact.points.iter().enumerate() {
            for (v, weight) in point.vertices.iter().zip(point.weights) {
                let d = Vector3::from_column_slice(&moves[m * v..m * v + 3]);
                slack[i] += weight * self.normals[i].dot(&d);
            }
            let row = &self.compliance[k * i..k * (i + 1)];
            slack[i] -= row.iter().zip(&self.lambda).map(|(w, l)| w * l).sum::<f64>();
        }
        let mut renewed = self.lambda.clone();
        let fine = 0.01 * self.contact.depth;
        let set = self.set.as_deref();
        projected_gauss_seidel(&self.compliance, &slack, &mut renewed, set, fine, SWEEPS);
        renewed
    }

    /// moves ← moves + Ĉ Gᵀ(λ' − λ).
    fn add_push(&mut self, renewed: &[f64], moves: &mut [f64]) {
        let m = self.problem.unknowns_per_vertex();
        self.push.fill(0.0);
        for (i, (point, _)) in self.contact.points.iter().enumerate() {
            let force = self.normals[i] * (renewed[i] - self.lambda[i]);
            for (&v, weight) in point.vertices.iter().zip(point.weights) {
                if self.problem.free[v] {
                    for axis in 0..3 {
                        self.push[m * v + axis] += weight * force[axis];
                    }
                }
            }
        }
        let mut pushed = vec![0.0; moves.len()];
        self.problem.precondition(&self.push, &mut self.scratch, &mut pushed);
        for (d, p) in moves.iter_mut().zip(&pushed) {
            *d += p;
        }
    }

    fn outcome(self) -> ContactOutcome {
        let deepest = self.gaps.iter().fold(0.0, |deepest: f64, gap| deepest.max(-gap));
        ContactOutcome {
            outcome: Outcome {
                iterations: self.iterations,
                evaluations: self.evaluations,
                residual: self.size,
                converged: self.merit() <= 1.0,
                method: "contact",
                fallbacks: self.fallbacks,
            },
            multipliers: self.lambda,
            normals: self.normals,
            compliance: self.compliance,
            penetration: deepest,
        }
    }
}

impl Contact<'_> {
    /// W = G T C_pp Tᵀ Gᵀ, k × k by rows, m/N.
    fn compliance(&self, normals: &[Vector3<f64>], problem: &Problem<'_>) -> Vec<f64> {
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
