//! The unknowns of a tetrahedron and its matrices: the swappable stage [`ElementFormulation`].
//!
//! `p1.rs` carries displacements, `p1p1.rs` pressures beside them; `dynamic.rs` is either with its
//! mass (`mass.rs`) and damping in a time step. Open `formulation.rs` first. To add one: a file
//! with a type that implements the trait, a line in [`formulation_by_name`].

mod dynamic;
mod formulation;
mod mass;
mod p1;
mod p1p1;

pub use dynamic::{Dynamic, StepWeights};
pub use formulation::ElementFormulation;
pub use mass::Mass;
pub use p1::P1;
pub use p1p1::{MixedModuli, P1P1};

use crate::error::EmbedError;

/// Scene names of the built-in elements.
pub const FORMULATIONS: &[&str] = &["p1", "p1p1"];

/// A built-in element, `p1p1` with its own choice of stabilisation.
///
/// # Errors
/// [`EmbedError::Unknown`] listing the choices.
pub fn formulation_by_name(name: &str) -> Result<Box<dyn ElementFormulation>, EmbedError> {
    match name {
        "p1" => Ok(Box::new(P1)),
        "p1p1" => Ok(Box::new(P1P1::default())),
        _ => Err(EmbedError::Unknown { what: "element", name: name.into(), choices: FORMULATIONS }),
    }
}

/// A built-in element in a time step, by the name of the element.
///
/// # Errors
/// [`EmbedError::Unknown`] listing the choices.
pub fn dynamic_by_name(
    name: &str,
    weights: StepWeights,
) -> Result<Box<dyn ElementFormulation>, EmbedError> {
    match name {
        "p1" => Ok(Box::new(Dynamic { element: P1, weights })),
        "p1p1" => Ok(Box::new(Dynamic { element: P1P1::default(), weights })),
        _ => formulation_by_name(name),
    }
}
