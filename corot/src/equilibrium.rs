//! The equilibrium problem and what a solver reports.

use nalgebra::Vector3;

use crate::Corotation;
use crate::body::Body;

/// Find x with f_int(x) = f_ext on the free vertices.
///
/// Solvers mix residuals and steps as plain vectors of [`rows`](Self::rows) entries, vertex-major,
/// and touch positions through the methods here alone: an element with further unknowns per vertex
/// changes this type, no solver.
pub struct Problem<'a> {
    /// Elements and rotations, renewed with every force evaluation.
    pub body: &'a mut Body,
    /// How forces follow from positions.
    pub corotation: &'a dyn Corotation,
    /// Loads by vertex number, N.
    pub external: &'a [Vector3<f64>],
    /// Which vertices may move; the others stay where `positions` has them.
    pub free: &'a [bool],
    /// y = C f: the inverse stiffness of the unrotated body with all but the free vertices
    /// fixed, both by vertex number (3 entries each), zero on the others. m/N.
    pub inverse: &'a dyn Fn(&[f64], &mut [f64]),
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Relative residual τ: ‖f_ext − f_int‖ over the free vertices must not exceed
    /// τ · max(‖f_ext‖, √Σ‖f_e‖²), nor need it fall below rounding, ε ‖K‖‖x‖.
    pub residual: f64,
    /// Iterations at most, of each method.
    pub max_iterations: usize,
}

/// How a solve ended. Positions and rotations are those of the smallest residual seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Applications of the inverse (of a tangent's factor for `newton`), by all methods together.
    pub iterations: usize,
    /// Evaluations of the internal forces, by all methods together.
    pub evaluations: usize,
    /// The relative residual reached.
    pub residual: f64,
    /// Whether the tolerance was reached.
    pub converged: bool,
    /// Scene name of the method that ran last: of the one that converged, if any did.
    pub method: &'static str,
    /// Methods that had given up before it.
    pub fallbacks: usize,
}

/// Finds equilibrium positions.
pub trait Equilibrium: Send {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Whether it needs [`Corotation::tangent`]; without it it then ends where it begins.
    fn needs_tangent(&self) -> bool {
        false
    }

    /// Moves the free vertices of `positions` (m, by vertex number) into equilibrium. On return
    /// `internal` holds the internal forces there (N): at vertices that are not free,
    /// internal − external is the reaction.
    fn solve(
        &mut self,
        problem: &mut Problem<'_>,
        positions: &mut [Vector3<f64>],
        internal: &mut [Vector3<f64>],
        tolerance: &Tolerance,
    ) -> Outcome;
}

impl Problem<'_> {
    /// Entries of a residual or a step: unknowns per vertex times vertex numbers.
    pub fn rows(&self) -> usize {
        self.corotation.unknowns_per_vertex() * self.free.len()
    }

    /// Evaluates internal forces and writes f_ext − f_int of the free vertices to `residual`
    /// (3 entries a vertex, 0 elsewhere). Returns its relative size,
    /// ‖f_ext − f_int‖ / max(‖f_ext‖, √Σ‖f_e‖², ε ‖K‖‖x‖ / τ): the last term lets a body that has
    /// come back to rest, where all forces are rounding, count as solved.
    pub fn evaluate(
        &mut self,
        positions: &[Vector3<f64>],
        internal: &mut [Vector3<f64>],
        residual: &mut [f64],
        tolerance: &Tolerance,
    ) -> f64 {
        let elements = self.corotation.internal_forces(self.body, positions, internal);
        let mut squares = 0.0;
        for v in 0..positions.len() {
            let r = if self.free[v] { self.external[v] - internal[v] } else { Vector3::zeros() };
            squares += r.norm_squared();
            residual[3 * v..3 * v + 3].copy_from_slice(r.as_slice());
        }
        let norm = |a: &[Vector3<f64>]| a.iter().map(Vector3::norm_squared).sum::<f64>().sqrt();
        let rounding = f64::EPSILON * self.body.stiffness_scale() * norm(positions);
        let scale = norm(self.external).max(elements).max(rounding / tolerance.residual);
        match squares.sqrt() {
            0.0 => 0.0,
            // An overflow is no small residual.
            _ if !scale.is_finite() => f64::NAN,
            size => size / scale,
        }
    }

    /// step = T C Tᵀ residual with T the vertices' rotations of the last evaluation: the warped
    /// inverse of Oishi et al., eq. (2), here the preconditioner.
    pub fn precondition(&self, residual: &[f64], scratch: &mut [f64], step: &mut [f64]) {
        let rotations = self.body.vertex_rotations();
        for (v, r) in rotations.iter().enumerate() {
            let at = 3 * v..3 * v + 3;
            let local = r.transpose() * Vector3::from_column_slice(&residual[at.clone()]);
            scratch[at].copy_from_slice(local.as_slice());
        }
        (self.inverse)(scratch, step);
        for (v, r) in rotations.iter().enumerate() {
            let at = 3 * v..3 * v + 3;
            let world = r * Vector3::from_column_slice(&step[at.clone()]);
            step[at].copy_from_slice(world.as_slice());
        }
    }

    /// x ← x + `length` · `step`.
    pub fn advance(&mut self, positions: &mut [Vector3<f64>], step: &[f64], length: f64) {
        for (x, d) in positions.iter_mut().zip(step.chunks_exact(3)) {
            *x += length * Vector3::from_column_slice(d);
        }
    }
}
