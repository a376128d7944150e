//! `goal`: what a bump on every edge would change of one figure.

use std::cell::RefCell;

use super::bumps::{Bumps, OVER_GAIN, Weight};
use super::ring::{Indicator, RingMember};
use super::sight::{Measured, Sight};

/// By element: its share of |rᵀA⁻¹r*| of each of its edges, with r and A as in
/// [`Residual`](super::Residual) and r* the residual of the dual z of the scene's `refinement.goal` (by
/// default the force of the first tool).
///
/// The mesh is fine where an error is made that the figure feels, and coarse where one is made that it
/// does not. A vertex goes out where a finer mesh would not ask for it: rings are not measured one by one.
///
/// Cost: as [`Residual`](super::Residual), a solve (two under contact) and the forces of z.
///
/// Source: Becker and Rannacher, Acta Numerica 10, 2001; with bumps in place of weighted jumps as in
/// Bank and Smith, SIAM J. Numer. Anal. 30(4), 1993.
#[derive(Default)]
pub struct Goal {
    bumps: RefCell<Bumps>,
}

impl Indicator for Goal {
    fn name(&self) -> &'static str {
        "goal"
    }

    fn remembers(&self) -> bool {
        false
    }

    fn unit(&self) -> &'static str {
        "of the goal"
    }

    fn measure(&self, _: &[RingMember]) -> f64 {
        f64::INFINITY
    }

    fn elements(&self, sight: &Sight<'_>) -> Option<Measured> {
        Some(self.bumps.borrow_mut().measure(sight, Weight::Goal))
    }

    fn estimates(&self) -> bool {
        true
    }

    fn error_over_sum(&self) -> Option<f64> {
        Some(OVER_GAIN)
    }

    fn is_of_goal(&self) -> bool {
        true
    }
}
