//! How positions are found at which forces balance the loads: the swappable stage [`Equilibrium`].
//!
//! `solver.rs` holds the trait, `problem.rs` what every solver works on, `iteration.rs` where an
//! iteration stands and the best place it has been at, `inverse.rs` what they precondition with, `following.rs`
//! loads that move with the body, `response.rs` how an equilibrium answers to small changes; one file per solver. Open `solver.rs` first. To add one: a file with a type that implements the trait,
//! a line in [`equilibrium_by_name`].

pub(crate) mod anderson;
mod direct;
pub(crate) mod fallback;
mod following;
mod inverse;
mod iteration;
mod lbfgs;
mod line_search;
mod newton;
mod problem;
mod residual_newton;
mod response;
mod solver;
mod sparse_lu;
mod tangent_system;

pub use anderson::Anderson;
pub use direct::Direct;
pub use fallback::Fallback;
pub use following::Following;
pub use inverse::{Inverse, reply_by_two};
pub use iteration::Iteration;
pub use lbfgs::Lbfgs;
pub use newton::Newton;
pub use problem::{Iterate, Outcome, Problem, Tolerance};
pub use residual_newton::ResidualNewton;
pub use response::{Attached, Disturbance};
pub use solver::Equilibrium;

use crate::error::CorotError;
use crate::forces::InternalForces;

/// Scene names of the built-in equilibrium solvers.
pub const EQUILIBRIA: &[&str] =
    &["fallback", "anderson", "lbfgs", "direct", "newton", "residual_newton"];

/// A built-in equilibrium solver.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices.
pub fn equilibrium_by_name(name: &str) -> Result<Box<dyn Equilibrium>, CorotError> {
    match name {
        "anderson" => Ok(Box::new(Anderson::default())),
        "lbfgs" => Ok(Box::new(Lbfgs::default())),
        "direct" => Ok(Box::new(Direct)),
        "newton" => Ok(Box::new(Newton::default())),
        "residual_newton" => Ok(Box::new(ResidualNewton)),
        "fallback" => Ok(Box::new(
            Fallback::new(
                "fallback",
                vec![
                    Box::new(Anderson::default()),
                    Box::new(Lbfgs::default()),
                    Box::new(Newton::default()),
                ],
            )
            .with_following(vec![Box::new(Anderson::default()), Box::new(ResidualNewton)]),
        )),
        _ => Err(CorotError::Unknown {
            what: "equilibrium solver",
            name: name.into(),
            choices: EQUILIBRIA,
        }),
    }
}

/// Whether these two work together.
///
/// # Errors
/// [`CorotError::NoTangent`] if the solver needs the tangent of forces that have none.
pub fn check_pair(
    forces: &dyn InternalForces,
    equilibrium: &dyn Equilibrium,
) -> Result<(), CorotError> {
    if equilibrium.needs_tangent() && forces.tangent().is_none() {
        let (corotation, equilibrium) = (forces.name(), equilibrium.name());
        return Err(CorotError::NoTangent { corotation, equilibrium });
    }
    Ok(())
}

/// Whether these two work on a [mixed](crate::Body::mixed) body.
///
/// # Errors
/// [`CorotError::NoPressures`] naming the stage that does not.
pub fn check_mixed(
    forces: &dyn InternalForces,
    equilibrium: &dyn Equilibrium,
) -> Result<(), CorotError> {
    let refused = |stage, name, choices| Err(CorotError::NoPressures { stage, name, choices });
    if !forces.carries_pressures() {
        return refused("corotation", forces.name(), "element, none");
    }
    if equilibrium.needs_definite() {
        return refused("equilibrium", equilibrium.name(), "fallback, anderson, newton, direct");
    }
    Ok(())
}
