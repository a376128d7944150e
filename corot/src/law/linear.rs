//! `linear`: linear elasticity.

use nalgebra::Matrix6;
use yawara_embed::Strain;

use super::constitutive_law::{ConstitutiveLaw, MaterialPoint};

/// σ = D ε̃.
#[derive(Clone, Copy, Debug, Default)]
pub struct LinearElastic;

impl ConstitutiveLaw for LinearElastic {
    fn name(&self) -> &str {
        "linear"
    }

    fn state_len(&self) -> usize {
        0
    }

    fn stress(&self, point: &MaterialPoint<'_>, _: &mut [f64]) -> Strain {
        point.elasticity * point.strain
    }

    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
        *point.elasticity
    }

    fn stiffening(&self, _: f64) -> f64 {
        1.0
    }

    fn is_linear(&self) -> bool {
        true
    }
}
