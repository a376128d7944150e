//! What asks for refinement: a swappable stage. Open `ring` first, it holds the trait.

mod energy;
mod residual;
mod ring;
mod rotation;
mod volume;

use crate::error::SimError;

pub use energy::Energy;
pub use residual::Residual;
pub use ring::{Indicator, RingMember, Sight};
pub use rotation::Rotation;
pub use volume::{Volume, child_volume_ratios};

/// Scene names of the built-in indicators.
pub const CHOICES: &[&str] = &["energy", "residual", "volume", "rotation"];

/// A built-in indicator.
/// # Errors
/// [`SimError::UnknownIndicator`] listing the choices.
pub fn by_name(name: &str) -> Result<Box<dyn Indicator>, SimError> {
    match name {
        "energy" => Ok(Box::new(Energy)),
        "residual" => Ok(Box::new(Residual)),
        "volume" => Ok(Box::new(Volume)),
        "rotation" => Ok(Box::new(Rotation)),
        _ => Err(SimError::UnknownIndicator(name.into(), CHOICES)),
    }
}
