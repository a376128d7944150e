//! Rotations, co-rotational forces and equilibrium solvers.
//!
//! Linear elasticity in a frame that turns with the material: each element (or vertex) has a
//! rotation R, and forces come from the strain of Rᵀx − X. Two stages are swappable: how forces
//! follow from positions ([`Corotation`]) and how positions are found at which they balance the
//! loads ([`Equilibrium`]). The inverse stiffness enters as a function; this crate knows no
//! maintainer of it.
#![forbid(unsafe_code)]

mod anderson;
mod body;
mod element_corotation;
mod equilibrium;
mod error;
pub mod rotation;

pub use anderson::Anderson;
pub use body::{Body, Element};
pub use element_corotation::ElementCorotation;
pub use equilibrium::{Equilibrium, Outcome, Problem, Tolerance};
pub use error::CorotError;

use nalgebra::Vector3;

/// How internal forces follow from positions.
pub trait Corotation: Send {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Adds nothing, overwrites `forces` with f_int(x) (N, one per vertex number) and renews the
    /// rotations of `body`. Returns √Σ_e ‖f_e‖², the scale against which residuals are measured.
    ///
    /// Cost: O(elements).
    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64;
}

/// Scene names of the built-in co-rotations.
pub const COROTATIONS: &[&str] = &["element"];

/// Scene names of the built-in equilibrium solvers.
pub const EQUILIBRIA: &[&str] = &["anderson"];

/// A built-in co-rotation.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices.
pub fn corotation_by_name(name: &str) -> Result<Box<dyn Corotation>, CorotError> {
    match name {
        "element" => Ok(Box::new(ElementCorotation)),
        _ => Err(CorotError::Unknown {
            what: "co-rotation",
            name: name.into(),
            choices: COROTATIONS,
        }),
    }
}

/// A built-in equilibrium solver.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices.
pub fn equilibrium_by_name(name: &str) -> Result<Box<dyn Equilibrium>, CorotError> {
    match name {
        "anderson" => Ok(Box::new(Anderson::default())),
        _ => Err(CorotError::Unknown {
            what: "equilibrium solver",
            name: name.into(),
            choices: EQUILIBRIA,
        }),
    }
}
