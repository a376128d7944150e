//! How a case is solved, and what it says.

use nalgebra::Vector3;
use serde::Serialize;
use yawara_corot::{Direct, Equilibrium, InternalForces, NoCorotation, Tolerance};

use crate::bodies::{Solid, Statics};
use crate::error::{BenchError, Result};

/// One figure against what it should be.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The case.
    pub case: &'static str,
    /// Elements along the length that the case counts by.
    pub refinement: usize,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// What is measured, with its unit.
    pub quantity: String,
    /// The figure.
    pub computed: f64,
    /// What it converges to.
    pub expected: f64,
    /// What the error is relative to: the expected figure where that is not 0.
    pub scale: f64,
    /// |computed − expected| / scale.
    pub relative_error: f64,
}

impl Row {
    /// A figure of a body with so many elements along its length.
    pub(super) fn new(
        case: &'static str,
        (refinement, solid): (usize, &Solid),
        quantity: impl Into<String>,
        computed: f64,
        expected: f64,
    ) -> Self {
        let (vertices, quantity, scale) = (solid.points.len(), quantity.into(), expected.abs());
        let relative_error = (computed - expected).abs() / scale;
        Self { case, refinement, vertices, quantity, computed, expected, scale, relative_error }
    }

    /// The same of a figure that should be 0 where others are as large as `scale`.
    pub(super) fn of_zero(
        case: &'static str,
        size: (usize, &Solid),
        quantity: String,
        computed: f64,
        scale: f64,
    ) -> Self {
        let relative_error = computed.abs() / scale;
        Self { scale, relative_error, ..Self::new(case, size, quantity, computed, 0.0) }
    }
}

/// Linear statics: the held vertices where they are, the free ones by the inverse.
pub(super) fn solve_linear(
    case: &'static str,
    statics: &mut Statics,
    load: &[Vector3<f64>],
) -> Result<()> {
    match solve(case, statics, &NoCorotation, &mut Direct, load, 1e-10) {
        // A hundred thousand tetrahedra round their forces to about that; no error here is near it.
        Err(BenchError::NotConverged { reached, .. }) if reached <= 1e-9 => Ok(()),
        other => other,
    }
}

/// Solves for the free vertices to a relative residual.
pub(super) fn solve(
    case: &'static str,
    statics: &mut Statics,
    corotation: &dyn InternalForces,
    equilibrium: &mut dyn Equilibrium,
    load: &[Vector3<f64>],
    residual: f64,
) -> Result<()> {
    let tolerance = Tolerance::new(residual, 300);
    let outcome = statics.solve(corotation, equilibrium, load, &tolerance, &|| ());
    if outcome.converged {
        return Ok(());
    }
    let (method, reached) = (outcome.method, outcome.residual);
    Err(BenchError::NotConverged { case, method, reached, limit: residual })
}
