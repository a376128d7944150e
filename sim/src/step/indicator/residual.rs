//! `residual`: what a bump on every edge would release.

use std::cell::RefCell;

use nalgebra::Vector3;

use super::bumps::{Bumps, OVER_GAIN, Weight};
use super::energy::Energy;
use super::ring::{Indicator, RingMember};
use super::sight::{Measured, Sight};

/// By element: its share of ½ rᵀA⁻¹r, J, of each of its edges, whose bump φ = 4 λ_a λ_b is out of balance
/// by r = ∫ fφ − ∫ σ∇φ and has the stiffness A = Σ ∫ G(∇φ)ᵀ D G(∇φ) over the elements around it.
///
/// ∫ σ∇φ is the sum of the elements' forces on both ends. Of what holds and touches fφ is exact, with its
/// stiffness in A; what else acts (weight, inertia) is spread over each vertex's elements by volume. An
/// edge between two held vertices has no bump. Unlike [`Energy`] it sees all that an element lacks, not
/// what its next vertex alone would bring. Rings to be merged are measured by [`Energy`].
///
/// Cost: some thousand flops per element; little where nothing has moved since the last time.
///
/// Source: Deuflhard, Leinen and Yserentant, IMPACT of Computing in Science and Engineering 1(1), 1989.
///
/// With pressures A has a bulk modulus of at most twice the shear modulus.
#[derive(Default)]
pub struct Residual {
    bumps: RefCell<Bumps>,
}

impl Indicator for Residual {
    fn name(&self) -> &'static str {
        "residual"
    }

    fn remembers(&self) -> bool {
        false
    }

    fn unit(&self) -> &'static str {
        "J"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        Energy.measure(ring)
    }

    fn measure_vertex(&self, ring: &[RingMember], surplus: &Vector3<f64>) -> f64 {
        Energy.measure_vertex(ring, surplus)
    }

    fn elements(&self, sight: &Sight<'_>) -> Option<Measured> {
        Some(self.bumps.borrow_mut().measure(sight, Weight::Energy))
    }

    fn estimates(&self) -> bool {
        true
    }

    fn error_over_sum(&self) -> Option<f64> {
        Some(OVER_GAIN)
    }
}
