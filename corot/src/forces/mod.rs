//! How internal forces follow from positions: the swappable stage [`InternalForces`].
//!
//! One file per choice: `element.rs` (the default), `element_reference.rs`, `row.rs`, `paper.rs`,
//! `none.rs`, `mass_spring.rs`; `tangent.rs` is the derivative of an element's forces. Open `internal_forces.rs`
//! first. To add one: a file with a type that implements the trait, a line in [`forces_by_name`].

mod element;
mod element_reference;
mod internal_forces;
mod mass_spring;
mod none;
mod paper;
mod row;
pub(crate) mod tangent;

pub use element::ElementCorotation;
pub use element_reference::ElementReference;
pub use internal_forces::InternalForces;
pub use mass_spring::MassSpring;
pub use none::NoCorotation;
pub use paper::PaperCorotation;
pub use row::RowCorotation;
pub use tangent::{ElementTangent, TangentOf, element_tangent};

use crate::error::CorotError;

/// Scene names of the built-in co-rotations.
pub const FORCES: &[&str] =
    &["element", "element_reference", "row", "paper", "none", "mass_spring"];

/// A built-in co-rotation.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices.
pub fn forces_by_name(name: &str) -> Result<Box<dyn InternalForces>, CorotError> {
    match name {
        "element" => Ok(Box::new(ElementCorotation)),
        "element_reference" => Ok(Box::new(ElementReference)),
        "row" => Ok(Box::new(RowCorotation)),
        "paper" => Ok(Box::new(PaperCorotation)),
        "none" => Ok(Box::new(NoCorotation)),
        "mass_spring" => Ok(Box::new(MassSpring::default())),
        _ => Err(CorotError::Unknown { what: "co-rotation", name: name.into(), choices: FORCES }),
    }
}
