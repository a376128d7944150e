//! A solve with contact under way: forces, gaps and what is left of both.

use nalgebra::Vector3;

use super::gauss_seidel::projected_gauss_seidel;
use super::surface_contact::{Contact, ContactOutcome};
use crate::equilibrium::{Iterate, Outcome, Problem, Tolerance};
use crate::field::Field;

/// Sweeps of an iteration at most: it need not be exact, the next one goes on from there.
const SWEEPS: usize = 60;

/// The cosine to the normal that W was made for, below which it is made anew.
const TURNED: f64 = 0.995;

/// Merit, where the body stands, and λ.
pub(super) type Place = (f64, Iterate, Vec<f64>);

/// A solve under way.
pub(super) struct Run<'a, 'b, 'p> {
    pub(super) problem: &'a mut Problem<'p>,
    pub(super) contact: &'a Contact<'b>,
    pub(super) internal: &'a mut Field,
    pub(super) tolerance: &'a Tolerance,
    pub(super) lambda: Vec<f64>,
    /// Which points push, where that is settled for now: with a force of either sign, and no other.
    pub(super) set: Option<Vec<bool>>,
    pub(super) gaps: Vec<f64>,
    pub(super) normals: Vec<Vector3<f64>>,
    /// Loads with the contact forces.
    pub(super) loads: Vec<Vector3<f64>>,
    pub(super) residual: Vec<f64>,
    pub(super) compliance: Vec<f64>,
    /// The normals that it is for.
    shaped: Vec<Vector3<f64>>,
    /// Corners of the points that are free to move, ascending.
    corners: Vec<usize>,
    /// The work so far and the residual of the last evaluation.
    pub(super) outcome: Outcome,
}

impl<'a, 'b, 'p> Run<'a, 'b, 'p> {
    pub(super) fn new(
        problem: &'a mut Problem<'p>,
        contact: &'a Contact<'b>,
        multipliers: &[f64],
        internal: &'a mut Field,
        tolerance: &'a Tolerance,
    ) -> Self {
        let (n, k) = (problem.rows(), contact.points.len());
        let mut lambda = multipliers.to_vec();
        lambda.resize(k, 0.0);
        let known = contact.known.unwrap_or_default();
        let all = contact.points.iter().flat_map(|(point, _)| point.vertices);
        let mut corners: Vec<usize> = all.filter(|&v| problem.free[v]).collect();
        corners.sort_unstable();
        corners.dedup();
        Self {
            loads: problem.external.to_vec(),
            residual: vec![0.0; n],
            set: None,
            gaps: vec![0.0; k],
            normals: vec![Vector3::zeros(); k],
            compliance: known.0.to_vec(),
            shaped: known.1.to_vec(),
            corners,
            outcome: Outcome { residual: f64::NAN, method: "contact", ..Outcome::default() },
            problem,
            contact,
            internal,
            tolerance,
            lambda,
        }
    }

    /// Renews gaps, normals, loads, forces and residual where the positions are.
    pub(super) fn evaluate(&mut self, positions: &Field) {
        self.loads.copy_from_slice(self.problem.external);
        for (i, (point, obstacle)) in self.contact.points.iter().enumerate() {
            let at = point.position(positions);
            (self.gaps[i], self.normals[i]) = self.contact.obstacles[*obstacle].gap(&at);
            for (v, weight) in point.vertices.iter().zip(point.weights) {
                self.loads[*v] += self.normals[i] * (self.lambda[i] * weight);
            }
        }
        let mut loaded = self.problem.with_loads(&self.loads);
        self.outcome.residual =
            loaded.evaluate(positions, self.internal, &mut self.residual, self.tolerance);
        self.outcome.evaluations += 1;
    }

    /// How far from converged, at most 1 when it is: the residual and what is deeper or farther
    /// than allowed, each in units of its limit.
    pub(super) fn merit(&self) -> f64 {
        if self.lambda.iter().any(|&force| force < 0.0) {
            return f64::INFINITY;
        }
        self.merit_with(self.gaps.iter().zip(&self.lambda).map(|(gap, lambda)| {
            let far = if *lambda > 0.0 { *gap } else { 0.0 };
            (-gap).max(far)
        }))
    }

    pub(super) fn merit_with(&self, off: impl Iterator<Item = f64>) -> f64 {
        let first = self.outcome.residual / self.tolerance.residual;
        largest(first, off.map(|off| off / self.contact.depth))
    }

    /// Where it stands.
    pub(super) fn place(&self, merit: f64, positions: &Field) -> Place {
        (merit, self.problem.iterate(positions), self.lambda.clone())
    }

    pub(super) fn return_to(&mut self, best: &Place, positions: &mut Field) {
        self.problem.return_to(&best.1, positions);
        self.lambda.copy_from_slice(&best.2);
        self.evaluate(positions);
    }

    /// moves ← Ĉ(r + Gᵀ(λ' − λ)), with 0 ≤ λ' ⊥ h + G Ĉ r + W(λ' − λ) ≥ 0; renews W and returns λ'.
    ///
    /// Where forces balance already, only the contacts move: r counts as 0.
    pub(super) fn plain_step(&mut self, moves: &mut [f64]) -> Vec<f64> {
        self.renew_compliance();
        if self.outcome.residual <= self.tolerance.residual {
            let renewed = self.forces_by_gaps(&vec![Vector3::zeros(); self.corners.len()]);
            moves.fill(0.0);
            if renewed != self.lambda {
                let mut push = vec![0.0; moves.len()];
                let m = self.problem.unknowns_per_vertex();
                for (&v, force) in self.corners.iter().zip(self.pushes_by(&renewed)) {
                    push[m * v..m * v + 3].copy_from_slice(force.as_slice());
                }
                self.problem.precondition(&push, &mut vec![0.0; moves.len()], moves);
            }
            return renewed;
        }
        let mut renewed = Vec::new();
        let reply = |there: &Field| {
            renewed = self.forces_by_gaps(there);
            self.pushes_by(&renewed)
        };
        self.problem.precondition_and_reply(&self.residual, &self.corners, reply, moves);
        renewed
    }

    /// W where there is none, or where a normal has turned too far since.
    pub(super) fn renew_compliance(&mut self) {
        let is_near = |(now, then): (&Vector3<f64>, &Vector3<f64>)| now.dot(then) > TURNED;
        let is_fit = self.shaped.len() == self.normals.len()
            && self.normals.iter().zip(&self.shaped).all(is_near);
        if !is_fit {
            self.compliance = self.contact.compliance(&self.normals, self.problem);
            self.shaped.clone_from(&self.normals);
        }
    }

    /// λ' with 0 ≤ λ' ⊥ h + G moves + W(λ' − λ) ≥ 0, `moves` those of the corners.
    fn forces_by_gaps(&self, moves: &Field) -> Vec<f64> {
        let k = self.lambda.len();
        let mut slack = self.gaps.clone();
        for (i, (point, _)) in self.contact.points.iter().enumerate() {
            for (v, weight) in point.vertices.iter().zip(point.weights) {
                if let Ok(at) = self.corners.binary_search(v) {
                    slack[i] += weight * self.normals[i].dot(&moves[at]);
                }
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

    /// Gᵀ(λ' − λ) on the corners.
    fn pushes_by(&self, renewed: &[f64]) -> Vec<Vector3<f64>> {
        let mut pushes = vec![Vector3::zeros(); self.corners.len()];
        for (i, (point, _)) in self.contact.points.iter().enumerate() {
            let force = self.normals[i] * (renewed[i] - self.lambda[i]);
            for (v, weight) in point.vertices.iter().zip(point.weights) {
                if let Ok(at) = self.corners.binary_search(v) {
                    pushes[at] += weight * force;
                }
            }
        }
        pushes
    }

    pub(super) fn into_outcome(self) -> ContactOutcome {
        ContactOutcome {
            outcome: Outcome { converged: self.merit() <= 1.0, ..self.outcome },
            penetration: self.gaps.iter().fold(0.0, |deepest: f64, gap| deepest.max(-gap)),
            multipliers: self.lambda,
            normals: self.normals,
            compliance: self.compliance,
            shaped: self.shaped,
        }
    }
}

/// The largest of all; no number where one of them is none.
fn largest(first: f64, others: impl Iterator<Item = f64>) -> f64 {
    others.fold(first, |most, one| if most.is_nan() || one <= most { most } else { one })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that has left all numbers, with gaps that still are some, has not converged.
    #[test]
    fn what_is_no_number_is_not_lost_among_others() {
        let of = |all: [f64; 3]| largest(all[0], all[1..].iter().copied());
        assert_eq!(of([0.5, 2.0, 1.0]), 2.0);
        for place in 0..3 {
            let mut all = [0.5, 0.2, 0.1];
            all[place] = f64::NAN;
            assert!(of(all).is_nan(), "{place}");
        }
    }
}
