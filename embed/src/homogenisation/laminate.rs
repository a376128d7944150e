//! `laminate`: traction is continuous across the cut between the halves.

use super::halves::{ChildPair, ParentMaterial, relaxed};
use super::rule::Homogenisation;

/// Keeps the parent's mean strain and lets the halves' strains differ by ±N d,
/// N = ½(G(g₁)−G(g₂)), so that energy is least and traction continuous across their interface:
///
/// X = −(Nᵀ(D₁+D₂)N)⁻¹ Nᵀ(D₁−D₂),
/// D_p = ½(D₁+D₂) − ½(D₁−D₂) N (Nᵀ(D₁+D₂)N)⁻¹ Nᵀ(D₁−D₂).
///
/// Symmetric positive definite, between the Reuss and Voigt bounds, exact for homogeneous
/// bodies and for layers parallel to the cut. Source: Milton, The Theory of Composites,
/// chapter 9.
#[derive(Clone, Copy, Debug, Default)]
pub struct Laminate;

impl Homogenisation for Laminate {
    fn name(&self) -> &str {
        "laminate"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        if pair.is_homogeneous() {
            return ParentMaterial::uniform(pair.elasticity[0]);
        }
        let (a, c) = pair.midpoint_energy();
        relaxed(pair, a, c)
    }
}
