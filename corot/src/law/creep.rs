//! `creep`: strain that stays at a rate, beyond a yield strain.

use yawara_embed::Strain;

use crate::error::CorotError;

/// While the elastic strain is larger than its yield, it turns into strain that stays at `rate_per_s` of itself, up
/// to a largest strain; sizes are √(ε:ε). It acts from the end of a step on, so that within a step all is elastic.
/// Unlike [`Plastic`](super::Plastic) it keeps no volume, and stresses may be as large as they like for a while.
/// # Source
/// Müller, Gross, Interactive virtual materials, Graphics Interface 2004, section 5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep {
    /// Strain up to which all is elastic.
    pub yield_strain: f64,
    /// 1/s.
    pub rate_per_s: f64,
    /// The most that stays.
    pub max_strain: f64,
}

impl Creep {
    /// # Errors
    /// [`CorotError::Range`] unless all are finite, the yield at least 0, rate and largest strain more than 0.
    pub fn new(yield_strain: f64, rate_per_s: f64, max_strain: f64) -> Result<Self, CorotError> {
        let refuse = |what, value, want| Err(CorotError::Range { what, value, want });
        if !(yield_strain >= 0.0 && yield_strain.is_finite()) {
            return refuse("the yield strain", yield_strain, "a finite number >= 0");
        }
        if !(rate_per_s > 0.0 && rate_per_s.is_finite()) {
            return refuse("the rate of creep, 1/s,", rate_per_s, "a finite number > 0");
        }
        if !(max_strain > 0.0 && max_strain.is_finite()) {
            return refuse("the largest strain of creep", max_strain, "a finite number > 0");
        }
        Ok(Self { yield_strain, rate_per_s, max_strain })
    }

    /// What stays after a step of `step_s` that ends with the elastic strain `elastic`, where `stays` did before.
    pub(super) fn flow(&self, elastic: &Strain, stays: &Strain, step_s: f64) -> Strain {
        let mut after = *stays;
        if size(elastic) > self.yield_strain && step_s.is_finite() {
            after += (self.rate_per_s * step_s).min(1.0) * elastic;
        }
        let size = size(&after);
        if size > self.max_strain { after * (self.max_strain / size) } else { after }
    }
}

/// √(ε:ε) of engineering strains.
pub(super) fn size(strain: &Strain) -> f64 {
    (strain.rows(0, 3).norm_squared() + 0.5 * strain.rows(3, 3).norm_squared()).sqrt()
}
