//! Linear constraints on positions: what holds the mean of a grip.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Vector3};

use super::grip::Grip;
use crate::body::Body;
use crate::vectors::{axpy, dot};

/// G x = g: rows on vertices, what they are to be, and how the body answers to them.
///
/// A row is a list of vertex numbers with their coefficients; rows are scaled to be of one unit.
#[derive(Clone, Debug, Default)]
pub struct Constraints {
    rows: Vec<Vec<(usize, Vector3<f64>)>>,
    targets: Vec<f64>,
    responses: Arc<Responses>,
}

/// How a body answers to the forces of constraints.
#[derive(Clone, Debug, Default)]
pub struct Responses {
    /// C Gᵀ of the unrotated body for the rows at the pose of rest: a column each, by vertex number
    /// with the body's unknowns per vertex.
    columns: Vec<Vec<f64>>,
    /// (G C Gᵀ)⁻¹ for these rows.
    inverse: DMatrix<f64>,
}

/// What a [`Constraints`] makes of the body's rotations as they are now: W = T C Gᵀ.
pub(crate) struct Turned<'a> {
    constraints: &'a Constraints,
    /// A column each; of a body, before it turns them.
    columns: Cow<'a, [Vec<f64>]>,
    body: Option<&'a Body>,
    /// (G W)⁻¹; entries that are not finite where it has none.
    inverse: DMatrix<f64>,
}

impl Grip {
    /// The six constraints on its mean, three where it can't feel a torque, at its pose R, t:
    ///
    /// Σ w (x_f − y_f) = 0 and Σ w (R r_f) × (x_f − y_f) = 0, r_f = X_f − c, both over Σ w and the
    /// second over ρ: rows in m. Multipliers are N; those of the second are torques over ρ.
    ///
    /// Source: the distributing coupling of finite-element codes.
    pub fn constraints(&self) -> Constraints {
        self.constraints_at(self.pose())
    }

    /// Those at the pose of rest.
    pub fn constraints_at_rest(&self) -> Constraints {
        self.constraints_at(&Isometry3::identity())
    }

    fn constraints_at(&self, pose: &Isometry3<f64>) -> Constraints {
        let mut constraints = Constraints::default();
        let turn = pose.rotation.to_rotation_matrix();
        let centre = pose * nalgebra::Point3::from(self.centre());
        let moments = self.moments();
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        for (k, axis) in axes.iter().enumerate() {
            let row = moments.iter().map(|(v, (first, _))| (*v, *first * axis));
            constraints.push(row.collect(), centre[k]);
        }
        if let Some(gyration) = self.gyration() {
            for axis in &axes {
                // e · (R a × x) = (e × R a) · x.
                let row =
                    moments.iter().map(|(v, (_, arm))| (*v, axis.cross(&(turn * arm)) / gyration));
                constraints.push(row.collect(), 0.0);
            }
        }
        constraints
    }
}

impl Constraints {
    fn push(&mut self, row: Vec<(usize, Vector3<f64>)>, target: f64) {
        self.rows.push(row);
        self.targets.push(target);
    }

    /// C Gᵀ and G C Gᵀ of these constraints, at the pose of rest, by C of the unrotated body with
    /// `unknowns` per vertex number: `apply` writes C f to its second argument.
    ///
    /// Cost: an application of C per row.
    /// # Errors
    /// Those of `apply`.
    pub fn answer<E>(
        &self,
        unknowns: usize,
        rows: usize,
        mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<Responses, E> {
        let mut columns = Vec::new();
        for row in &self.rows {
            let (mut force, mut column) = (vec![0.0; rows], vec![0.0; rows]);
            for (v, g) in row {
                (0..3).for_each(|axis| force[unknowns * v + axis] += g[axis]);
            }
            apply(&force, &mut column)?;
            columns.push(column);
        }
        let inverse = self.inverse_of(&columns, unknowns, None);
        Ok(Responses { columns, inverse })
    }

    /// (G W)⁻¹ of columns W, which `body` turns first; not a number where there is none.
    fn inverse_of(
        &self,
        columns: &[Vec<f64>],
        unknowns: usize,
        body: Option<&Body>,
    ) -> DMatrix<f64> {
        let n = self.len();
        let mut product = DMatrix::zeros(n, n);
        for (i, row) in self.rows.iter().enumerate() {
            for (v, g) in row {
                let turn = body.and_then(|body| body.vertex_rotations().get(*v));
                let local = turn.map_or(*g, |turn| turn.tr_mul(g));
                for (j, column) in columns.iter().enumerate() {
                    let entries = &column[unknowns * v..unknowns * v + 3];
                    product[(i, j)] += local.dot(&Vector3::from_column_slice(entries));
                }
            }
        }
        product.try_inverse().unwrap_or_else(|| DMatrix::repeat(n, n, f64::NAN))
    }

    /// Adds those of `other`, without its responses.
    pub fn extend(&mut self, other: Self) {
        self.rows.extend(other.rows);
        self.targets.extend(other.targets);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The vertices and coefficients of a row.
    ///
    /// # Panics
    /// If there is none of that number.
    pub fn row(&self, number: usize) -> &[(usize, Vector3<f64>)] {
        &self.rows[number]
    }

    /// The same rows with the body's answers: those of the rows at the pose of rest. What a solve
    /// ends in does not depend on them, its speed does.
    #[must_use]
    pub fn with_responses(self, responses: Arc<Responses>) -> Self {
        Self { responses, ..self }
    }

    /// H C Gᵀ (G C Gᵀ)⁻¹ G C Hᵀ of the unrotated body for some loads H (each of rows of a vector by
    /// vertex number, and forces): by how much less it gives way to them for being held, m/N.
    pub fn stiffening(&self, loads: &[Vec<(usize, f64)>]) -> DMatrix<f64> {
        let Responses { columns, inverse } = &*self.responses;
        let rows = DMatrix::from_fn(loads.len(), columns.len(), |i, j| {
            loads[i].iter().map(|&(row, force)| force * columns[j][row]).sum()
        });
        &rows * inverse * rows.transpose()
    }

    /// g − G x at `positions` (by vertex number, m).
    pub fn lack(&self, positions: &[Vector3<f64>]) -> DVector<f64> {
        DVector::from_fn(self.len(), |k, _| {
            let here: f64 = self.rows[k].iter().map(|(v, g)| g.dot(&positions[*v])).sum();
            self.targets[k] - here
        })
    }

    /// G y of a vector with `unknowns` per vertex, displacements first.
    fn times(&self, y: &[f64], unknowns: usize) -> DVector<f64> {
        DVector::from_fn(self.len(), |k, _| {
            let entry = |v: usize| Vector3::from_column_slice(&y[unknowns * v..unknowns * v + 3]);
            self.rows[k].iter().map(|(v, g)| g.dot(&entry(*v))).sum()
        })
    }

    /// W and (G W)⁻¹ with the rotations of `body`.
    pub(crate) fn turned<'a>(&'a self, body: &'a Body) -> Turned<'a> {
        let Responses { columns, .. } = &*self.responses;
        let inverse = self.inverse_of(columns, body.unknowns_per_vertex(), Some(body));
        Turned { constraints: self, columns: columns.into(), body: Some(body), inverse }
    }

    /// With columns W of a body with `unknowns` per vertex.
    pub(crate) fn answered_by(&self, columns: Vec<Vec<f64>>, unknowns: usize) -> Turned<'_> {
        let inverse = self.inverse_of(&columns, unknowns, None);
        Turned { constraints: self, columns: columns.into(), body: None, inverse }
    }

    /// The forces −Gᵀμ of the constraints on the body in equilibrium, N: per row vertex numbers with
    /// forces. `residual` is f_ext − f_int without them, the body's unknowns per vertex.
    pub fn forces(&self, body: &Body, residual: &[f64]) -> Vec<Vec<(usize, Vector3<f64>)>> {
        let multipliers = self.turned(body).multipliers(residual);
        self.weighted(&-multipliers)
    }

    /// The forces of the constraints while `forces` (by vertex number, N) come to act on the linear body
    /// with the rotations of `body`, and the targets change by `lead`, δ: −Gᵀμ + Gᵀ(G W)⁻¹ δ, as
    /// [`forces`](Self::forces).
    pub fn forces_under(
        &self,
        body: &Body,
        forces: &[Vector3<f64>],
        lead: Option<&DVector<f64>>,
    ) -> Vec<Vec<(usize, Vector3<f64>)>> {
        let m = body.unknowns_per_vertex();
        let mut residual = vec![0.0; m * forces.len()];
        for (v, force) in forces.iter().enumerate() {
            residual[m * v..m * v + 3].copy_from_slice(force.as_slice());
        }
        let turned = self.turned(body);
        let mut weights = -turned.multipliers(&residual);
        if let Some(lead) = lead {
            weights += &turned.inverse * lead;
        }
        self.weighted(&weights)
    }

    /// Each row times a weight.
    fn weighted(&self, weights: &DVector<f64>) -> Vec<Vec<(usize, Vector3<f64>)>> {
        let of = |(row, weight): (&Vec<(usize, Vector3<f64>)>, &f64)| {
            row.iter().map(|(v, g)| (*v, *weight * g)).collect()
        };
        self.rows.iter().zip(weights.iter()).map(of).collect()
    }

    /// How the multipliers of three rows from `first` on (a grip's forces) grow with their targets,
    /// (G W)⁻¹, N/m: the stiffness that the grip feels while it does not turn.
    pub fn stiffness(&self, body: &Body, first: usize) -> Matrix3<f64> {
        let inverse = self.turned(body).inverse;
        Matrix3::from_fn(|i, j| inverse[(first + i, first + j)])
    }
}

impl Turned<'_> {
    /// μ = (G W)⁻ᵀ Wᵀ r for a residual r: r − Gᵀμ is what the constraints leave of it.
    pub fn multipliers(&self, residual: &[f64]) -> DVector<f64> {
        let mut residual = Cow::Borrowed(residual);
        if let Some(body) = self.body {
            body.turn_back(residual.to_mut());
        }
        let products = self.columns.iter().map(|w| dot(w, &residual));
        self.inverse.tr_mul(&DVector::from_iterator(self.columns.len(), products))
    }

    /// r ← r − Gᵀμ on the vertices that are `free`.
    pub fn balance(&self, residual: &mut [f64], unknowns: usize, free: &[bool]) {
        let multipliers = self.multipliers(residual);
        for (row, mu) in self.constraints.rows.iter().zip(multipliers.iter()) {
            for (v, g) in row.iter().filter(|(v, _)| free[*v]) {
                (0..3).for_each(|axis| residual[unknowns * v + axis] -= mu * g[axis]);
            }
        }
    }

    /// d ← d − W (G W)⁻¹ (G d − `lack`): the step for which G(x + d) is g where `lack` = g − G x.
    pub fn correct(&self, step: &mut [f64], unknowns: usize, lack: Option<DVector<f64>>) {
        let mut off = self.constraints.times(step, unknowns);
        if let Some(lack) = lack {
            off -= lack;
        }
        let weights = &self.inverse * off;
        let mut more = vec![0.0; step.len()];
        for (column, weight) in self.columns.iter().zip(weights.iter()) {
            axpy(-weight, column, &mut more);
        }
        if let Some(body) = self.body {
            body.turn(&mut more);
        }
        axpy(1.0, &more, step);
    }
}
