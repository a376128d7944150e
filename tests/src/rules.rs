//! The homogenisations that rings are handed over with.

use nalgebra::{Matrix6, SMatrix};
use yawara_embed::{ChildPair, Excess, Homogenisation, ParentMaterial, by_name};

/// A rule of a user: stiffer than the Voigt mean in one direction, softer in the others, and
/// nothing said about factors.
pub struct Skewed;

impl Homogenisation for Skewed {
    fn name(&self) -> &str {
        "skewed"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        let [d1, d2] = pair.elasticity;
        let scale = Matrix6::from_diagonal(&[1.1, 0.95, 0.9, 0.97, 0.95, 0.93].into());
        let elasticity = scale * (0.5 * (d1 + d2)) * scale;
        ParentMaterial { elasticity, midpoint: SMatrix::zeros(), excess: Excess::Unfactored }
    }
}

/// `linear`, `laminate`, `paper` for 0, 1 and 2, and [`Skewed`] for the rest.
pub fn rule(number: usize) -> Box<dyn Homogenisation> {
    match number {
        0 => by_name("linear").unwrap(),
        1 => by_name("laminate").unwrap(),
        2 => by_name("paper").unwrap(),
        _ => Box::new(Skewed),
    }
}
