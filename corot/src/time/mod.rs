//! How a body moves on in time: the swappable stage [`TimeIntegrator`].
//!
//! `implicit_euler.rs`, `newmark.rs` and `quasi_static.rs` are its choices; `inertia.rs` is what a step adds to
//! the internal forces. Open `integrator.rs` first. To add one: a file with a type that implements
//! the trait, a line in [`integrator_by_name`].

mod implicit_euler;
mod inertia;
mod integrator;
mod newmark;
mod quasi_static;

pub use implicit_euler::ImplicitEuler;
pub use inertia::{Inertia, forces_with_inertia};
pub use integrator::{TimeIntegrator, TimeStep, VertexMotion};
pub use newmark::Newmark;
pub use quasi_static::QuasiStatic;

use crate::error::CorotError;

/// Scene names of the built-in integrators.
pub const INTEGRATORS: &[&str] = &["implicit_euler", "newmark", "quasi_static"];

/// A built-in integrator.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices.
pub fn integrator_by_name(name: &str) -> Result<Box<dyn TimeIntegrator>, CorotError> {
    match name {
        "implicit_euler" => Ok(Box::new(ImplicitEuler)),
        "newmark" => Ok(Box::new(Newmark)),
        "quasi_static" => Ok(Box::new(QuasiStatic)),
        _ => Err(CorotError::Unknown {
            what: "time integrator",
            name: name.into(),
            choices: INTEGRATORS,
        }),
    }
}
