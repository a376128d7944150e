//! From the two halves of a bisected tetrahedron to the whole: the swappable stage
//! [`Homogenisation`].
//!
//! `halves.rs` is what goes in and comes out, `rule.rs` the trait; one file per rule: `laminate.rs`
//! (the default), `linear.rs`, `hierarchical.rs` and `kharevych.rs` (both by `response.rs`), `paper.rs`.
//! Open `rule.rs` first. To add one: a file with a type that implements the trait, a line in
//! [`by_name`].

mod halves;
mod hierarchical;
mod kharevych;
mod laminate;
mod linear;
mod paper;
mod response;
mod rule;
mod solid;

pub use halves::{ChildPair, Excess, ParentMaterial};
pub use hierarchical::Hierarchical;
pub use kharevych::Kharevych;
pub use laminate::Laminate;
pub use linear::Linear;
pub use paper::Paper;
pub use rule::{GlobalHomogenisation, Homogenisation};
pub(crate) use solid::combine_solids;

use crate::error::EmbedError;

/// Scene names of the built-in choices.
pub const CHOICES: &[&str] = &["laminate", "linear", "hierarchical", "kharevych", "paper"];

/// A built-in homogenisation.
///
/// # Errors
/// [`EmbedError::Unknown`] listing the choices.
pub fn by_name(name: &str) -> Result<Box<dyn Homogenisation>, EmbedError> {
    match name {
        "laminate" => Ok(Box::new(Laminate)),
        "linear" => Ok(Box::new(Linear)),
        "hierarchical" => Ok(Box::new(Hierarchical)),
        "kharevych" => Ok(Box::new(Kharevych)),
        "paper" => Ok(Box::new(Paper)),
        _ => {
            Err(EmbedError::Unknown { what: "homogenisation", name: name.into(), choices: CHOICES })
        }
    }
}
