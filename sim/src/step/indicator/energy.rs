//! `energy`: what the new vertex would release.

use super::ring::{Indicator, RingMember, midpoint_of_least_energy};

/// η = ½ rᵀA⁻¹r, r and A⁻¹r those of [`midpoint_of_least_energy`]; J.
///
/// For `linear` exactly the energy that the new vertex would release at frozen neighbours (a
/// hierarchical-basis residual estimator: Bank and Smith, SIAM J. Numer. Anal. 30(4), 1993).
#[derive(Clone, Copy, Debug, Default)]
pub struct Energy;

impl Indicator for Energy {
    fn name(&self) -> &'static str {
        "energy"
    }

    fn unit(&self) -> &'static str {
        "J"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        midpoint_of_least_energy(ring).map_or(0.0, |(force, offset)| 0.5 * force.dot(&offset))
    }

    /// One bisection takes this share of what all after it take: energies of errors go with the square
    /// of the edge, which a bisection makes shorter by 2^⅓.
    fn error_over_sum(&self) -> Option<f64> {
        Some(1.0 / (1.0 - 0.5f64.powf(2.0 / 3.0)))
    }
}
