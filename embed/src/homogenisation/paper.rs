//! `paper`: the new vertex is left free of traction in each parent by itself.

use super::halves::{ChildPair, ParentMaterial, relaxed};
use super::rule::Homogenisation;

/// H = −K_MM⁻¹K_MT per isolated parent, K_p = K_TT + HᵀK_MT, in terms of strains:
/// X = −(ΣG_cᵀD_cG_c)⁻¹ ΣG_cᵀD_c, D_p = ½(ΣD_c + (ΣD_cG_c)X).
///
/// M lies on the parent's boundary, where the neighbours hold it; here nothing does. Even a
/// homogeneous pair therefore gets softer with every level (strain stiffness × 0.235 after
/// three levels at ν = 0.3): kept as the reference of the paper, not for use.
/// Source: Oishi et al., eqs. (5)–(8); eq. (7)'s product is 3×6.
#[derive(Clone, Copy, Debug, Default)]
pub struct Paper;

impl Homogenisation for Paper {
    fn name(&self) -> &str {
        "paper"
    }

    fn warning(&self) -> Option<&str> {
        Some(
            "the paper's condensation loses stiffness with every level, even between equal \
             materials (to 0.235 after 3 levels at a Poisson ratio of 0.3)",
        )
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        let [g1, g2] = pair.strain_operators();
        let [d1, d2] = pair.elasticity;
        let stiffness = g1.transpose() * d1 * g1 + g2.transpose() * d2 * g2;
        relaxed(pair, stiffness, d1 * g1 + d2 * g2)
    }
}
