//! What asks for refinement: a swappable stage. Open `ring` first, it holds the trait; `sight` is
//! what one that looks at the whole body sees, `bumps` what `residual` and `goal` measure there,
//! `stencils` what of it lasts from step to step.

mod bumps;
mod energy;
mod goal;
mod residual;
mod ring;
mod rotation;
mod sight;
mod stencils;
mod volume;

use crate::error::SimError;

pub use energy::Energy;
pub use goal::Goal;
pub use residual::Residual;
pub use ring::{Indicator, RingMember};
pub use rotation::Rotation;
pub use sight::{Dual, Measured, Sight};
pub use volume::{Volume, child_volume_ratios};

/// Scene names of the built-in indicators.
pub const CHOICES: &[&str] = &["energy", "residual", "goal", "volume", "rotation"];

/// A built-in indicator.
/// # Errors
/// [`SimError::UnknownIndicator`] listing the choices.
pub fn by_name(name: &str) -> Result<Box<dyn Indicator>, SimError> {
    match name {
        "energy" => Ok(Box::new(Energy)),
        "residual" => Ok(Box::<Residual>::default()),
        "goal" => Ok(Box::<Goal>::default()),
        "volume" => Ok(Box::new(Volume)),
        "rotation" => Ok(Box::new(Rotation)),
        _ => Err(SimError::UnknownIndicator(name.into(), CHOICES)),
    }
}
