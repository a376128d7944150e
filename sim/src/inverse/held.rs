//! Solves in which further vertices are held, without a change of the inverse.

use std::sync::Arc;

use faer::Mat;
use faer::linalg::solvers::{Llt, Solve};
use nalgebra::{DMatrix, Vector3};
use yawara_inverse_update::{InverseMaintainer, Load};
use yawara_mesh::VertexId;

use super::DISPLACEMENTS;
use super::slots::SlotMap;
use crate::error::SimError;

/// What is known of the vertices that tools hold, until the mesh or the hold changes.
pub(super) struct Held {
    /// Updates of the inverse when this was made.
    pub updates: usize,
    /// Slots of the held vertices.
    pub slots: Vec<usize>,
    /// C_:p for the displacements p, where the maintainer has it at hand.
    columns: Option<Mat<f64>>,
    /// Of C_pp for the displacements p, positive definite even where pressures make C indefinite.
    factor: Llt<f64>,
}

impl Held {
    /// Factors the compliance of the vertices in `slots`.
    /// # Errors
    /// [`SimError::Inverse`]; [`SimError::ComplianceNotPositive`] if the inverse is damaged.
    pub fn new(
        maintainer: &dyn InverseMaintainer,
        unknowns: usize,
        updates: usize,
        slots: Vec<usize>,
    ) -> Result<Self, SimError> {
        let m = unknowns;
        let n = DISPLACEMENTS * slots.len();
        // Of a slot's unknowns the displacements.
        let of = |i: usize| m * (i / DISPLACEMENTS) + i % DISPLACEMENTS;
        let (columns, block) = if maintainer.holds_columns() {
            let all = maintainer.columns(&slots)?;
            let row = |i: usize| m * slots[i / DISPLACEMENTS] + i % DISPLACEMENTS;
            let block = Mat::from_fn(n, n, |i, j| all[(row(i), of(j))]);
            let columns = match m {
                DISPLACEMENTS => all,
                _ => Mat::from_fn(all.nrows(), n, |i, j| all[(i, of(j))]),
            };
            (Some(columns), block)
        } else {
            (None, maintainer.compliance(&units(&slots, m))?)
        };
        let factor = Llt::new(block.as_ref(), faer::Side::Lower)
            .map_err(|_| SimError::ComplianceNotPositive(slots.len()))?;
        Ok(Self { updates, slots, columns, factor })
    }
}

/// Unit loads on the displacements of `slots`, whose vertices have `unknowns` each.
fn units(slots: &[usize], unknowns: usize) -> Vec<Load> {
    let unit = |slot: usize| (0..DISPLACEMENTS).map(move |a| vec![(unknowns * slot + a, 1.0)]);
    slots.iter().flat_map(|&slot| unit(slot)).collect()
}

/// K⁻¹ with some vertices held: C − C_:p C_pp⁻¹ C_p:.
pub(crate) struct Constrained<'a> {
    pub(super) maintainer: &'a dyn InverseMaintainer,
    pub(super) slots: &'a SlotMap,
    /// Unknowns per vertex.
    pub(super) unknowns: usize,
    pub(super) held: Arc<Held>,
}

impl Constrained<'_> {
    /// Slots of the vertices that are held beside the fixed ones.
    pub fn slots(&self) -> &[usize] {
        &self.held.slots
    }

    /// y = C f by vertex number (the element's unknowns each), displacements zero on held and fixed
    /// vertices.
    pub fn apply(&self, f: &[f64], y: &mut [f64]) -> Result<(), SimError> {
        let m = self.unknowns;
        let local = self.slots.gather(m, f);
        let mut solution = vec![0.0; local.len()];
        self.maintainer.apply(&local, &mut solution)?;
        let slots = &self.held.slots;
        if !slots.is_empty() {
            let at_held =
                Mat::from_fn(3 * slots.len(), 1, |i, _| solution[m * slots[i / 3] + i % 3]);
            self.subtract_columns(&self.held.factor.solve(&at_held), &mut solution)?;
            for &slot in slots {
                solution[m * slot..m * slot + DISPLACEMENTS].fill(0.0);
            }
        }
        self.slots.scatter(m, &solution, y);
        Ok(())
    }

    /// As [`apply`](Self::apply), with the digits that a preconditioner needs where no vertex is held.
    pub fn precondition(&self, f: &[f64], y: &mut [f64]) -> Result<(), SimError> {
        if !self.held.slots.is_empty() {
            return self.apply(f, y);
        }
        let local = self.slots.gather(self.unknowns, f);
        let mut solution = vec![0.0; local.len()];
        self.maintainer.precondition(&local, &mut solution)?;
        self.slots.scatter(self.unknowns, &solution, y);
        Ok(())
    }

    /// Whether [`precondition_and_reply`](Self::precondition_and_reply) can be had: no vertex is held.
    pub fn can_reply(&self) -> bool {
        self.held.slots.is_empty()
    }

    /// y = C (f + e), where e acts on some `rows` alone, of vertices that have unknowns, and `reply`
    /// chooses it by what C f is there, with the digits that a preconditioner needs.
    pub fn precondition_and_reply(
        &self,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        y: &mut [f64],
    ) -> Result<(), SimError> {
        let m = self.unknowns;
        let place = |row: &usize| Some(m * self.slots.get(VertexId((row / m) as u32))? + row % m);
        let places: Vec<usize> = rows.iter().filter_map(place).collect();
        let local = self.slots.gather(m, f);
        let mut solution = vec![0.0; local.len()];
        self.maintainer.precondition_and_reply(&local, &places, reply, &mut solution)?;
        self.slots.scatter(m, &solution, y);
        Ok(())
    }

    /// G C Gᵀ with the held vertices fixed, for loads G (by vertex number, as [`apply`](Self::apply) has
    /// them) on vertices that have unknowns and are not held; with the digits of
    /// [`precondition`](Self::precondition).
    pub fn compliance(&self, loads: &[Load]) -> Result<Mat<f64>, SimError> {
        let m = self.unknowns;
        let slot = |v: usize| self.slots.get(VertexId(v as u32));
        let local = |load: &Load| -> Load {
            load.iter().filter_map(|(row, f)| Some((m * slot(row / m)? + row % m, *f))).collect()
        };
        let mut all: Vec<Load> = loads.iter().map(local).collect();
        all.extend(units(&self.held.slots, m));
        let whole = match self.held.slots.is_empty() {
            true => self.maintainer.rough_compliance(&all)?,
            false => self.maintainer.compliance(&all)?,
        };
        let k = loads.len();
        let mut block = whole.submatrix(0, 0, k, k).to_owned();
        if all.len() > k {
            let at_held = whole.submatrix(k, 0, all.len() - k, k);
            block -= at_held.transpose() * self.held.factor.solve(at_held);
        }
        Ok(block)
    }

    /// The unknowns that follow when the held vertices are moved by `moves` (in the order of
    /// `held`) in the unrotated linear body: C_:p C_pp⁻¹ moves, by vertex number.
    pub fn drag(&self, moves: &[Vector3<f64>], y: &mut [f64]) -> Result<(), SimError> {
        let rhs = Mat::from_fn(3 * self.held.slots.len(), 1, |i, _| moves[i / 3][i % 3]);
        let mut solution = vec![0.0; self.unknowns * self.slots.len()];
        self.subtract_columns(&(-self.held.factor.solve(&rhs)), &mut solution)?;
        self.slots.scatter(self.unknowns, &solution, y);
        Ok(())
    }

    /// C_pp⁻¹ on the held displacements in the order of `held`, N/m.
    pub fn stiffness(&self) -> DMatrix<f64> {
        let n = DISPLACEMENTS * self.held.slots.len();
        let inverse = self.held.factor.solve(Mat::<f64>::identity(n, n));
        DMatrix::from_fn(n, n, |i, j| inverse[(i, j)])
    }

    /// target ← target − C_:p weights.
    fn subtract_columns(&self, weights: &Mat<f64>, target: &mut [f64]) -> Result<(), SimError> {
        if let Some(columns) = &self.held.columns {
            for j in 0..columns.ncols() {
                let weight = weights[(j, 0)];
                for (t, c) in target.iter_mut().zip(columns.col(j).iter()) {
                    *t -= weight * c;
                }
            }
            return Ok(());
        }
        let m = self.unknowns;
        let mut load = vec![0.0; target.len()];
        for (i, &slot) in self.held.slots.iter().enumerate() {
            for a in 0..3 {
                load[m * slot + a] = weights[(3 * i + a, 0)];
            }
        }
        let mut product = vec![0.0; target.len()];
        self.maintainer.apply(&load, &mut product)?;
        for (t, p) in target.iter_mut().zip(&product) {
            *t -= p;
        }
        Ok(())
    }
}
