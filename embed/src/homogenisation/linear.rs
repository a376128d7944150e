//! `linear`: the new vertex stays in the middle of its edge.

use super::halves::{ChildPair, ParentMaterial};
use super::rule::Homogenisation;

/// X = 0, D_p = ½(D₁+D₂): the Voigt bound. Exact for homogeneous bodies, too stiff otherwise;
/// conforming, so that a split changes the stiffness by rank 3 only.
#[derive(Clone, Copy, Debug, Default)]
pub struct Linear;

impl Homogenisation for Linear {
    fn name(&self) -> &str {
        "linear"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        ParentMaterial::uniform(pair.mean_elasticity())
    }
}
