//! `rayleigh`: linear elasticity with damping proportional to stiffness.

use nalgebra::Matrix6;
use yawara_embed::Strain;

use super::constitutive_law::{ConstitutiveLaw, LawHalf, MaterialPoint};
use crate::error::CorotError;

/// σ = D (ε̃ + (β/Δt)(ε̃ − ε̃ₙ)), ε̃ₙ the strain at the start of the step: β K v of Rayleigh's damping
/// as the material sees it, so that a body that only turns is not damped. Its state is ε̃ₙ.
///
/// Where no time passes (Δt infinite) it is linear elasticity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rayleigh {
    damping_s: f64,
}

impl Rayleigh {
    /// With β (s).
    ///
    /// # Errors
    /// [`CorotError::Range`] unless β is finite and at least 0.
    pub fn new(damping_s: f64) -> Result<Self, CorotError> {
        if damping_s >= 0.0 && damping_s.is_finite() {
            return Ok(Self { damping_s });
        }
        let (what, want) = ("damping by stiffness, s,", "a finite number >= 0");
        Err(CorotError::Range { what, value: damping_s, want })
    }
}

impl ConstitutiveLaw for Rayleigh {
    fn name(&self) -> &str {
        "rayleigh"
    }

    fn state_len(&self) -> usize {
        6
    }

    fn stress(&self, point: &MaterialPoint<'_>, trial: &mut [f64]) -> Strain {
        trial.copy_from_slice(point.strain.as_slice());
        let change = point.strain - Strain::from_column_slice(point.state);
        point.elasticity * (point.strain + self.damping_s / point.step_s * change)
    }

    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
        point.elasticity * self.stiffening(point.step_s)
    }

    fn stiffening(&self, step_s: f64) -> f64 {
        1.0 + self.damping_s / step_s
    }

    fn merge(&self, halves: &[LawHalf<'_>; 2], parent: &mut [f64]) {
        parent.copy_from_slice(LawHalf::mean_strain(halves, 0).as_slice());
    }
}
