//! How far to go along a direction, by the force along it alone.

use super::iteration::Iteration;
use super::problem::Problem;
use crate::vectors::dot;

/// Trials at most.
const TRIALS: usize = 12;

/// The longest step tried, in units of the direction.
pub(crate) const LONGEST: f64 = 8.0;

/// Moves `point` along `direction` to where the slope φ'(α) = −r(x + αd)·d of the energy is no more than `flat` of
/// φ'(0), in either direction: the strong curvature condition. Returns α; where the slope jumps from below zero to
/// above, as where an element turns over, the end of the bracket that lies below; 0 with `point` where it was if
/// `direction` does not lead downhill at all.
///
/// There need not be an energy, nor one that is known to more digits than the solution asks for:
/// from φ'(0) < 0 on, the first bracket in which the slope changes its sign is halved by secants.
/// Source: the approximate Wolfe conditions of Hager and Zhang, SIAM J. Optim. 16(1), 2005.
pub(crate) fn search(
    problem: &mut Problem<'_>,
    point: &mut Iteration<'_>,
    direction: &[f64],
    flat: f64,
) -> f64 {
    let start = -dot(&point.residual, direction);
    if !(start < 0.0 && start.is_finite()) {
        return 0.0;
    }
    let base = point.positions.to_vec();
    let (mut low, mut high): ((f64, f64), Option<(f64, f64)>) = ((0.0, start), None);
    let mut length = 1.0;
    for _ in 0..TRIALS {
        point.positions.copy_from_slice(&base);
        point.advance(problem, direction, length);
        let slope = -dot(&point.residual, direction);
        if !(slope.is_finite() && point.size.is_finite()) {
            high = Some((length, f64::INFINITY));
        } else if point.is_solved() || slope.abs() <= flat * -start {
            return length;
        } else if slope < 0.0 {
            low = (length, slope);
        } else {
            high = Some((length, slope));
        }
        length = match high {
            Some(high) => between(low, high),
            None if low.0 >= LONGEST => return length,
            None => (2.0 * low.0).min(LONGEST),
        };
    }
    point.positions.copy_from_slice(&base);
    point.advance(problem, direction, low.0);
    low.0
}

/// Where the chord of the slope is zero, kept away from the ends.
fn between(low: (f64, f64), high: (f64, f64)) -> f64 {
    let width = high.0 - low.0;
    let fraction = if high.1.is_finite() { low.1 / (low.1 - high.1) } else { 0.5 };
    low.0 + width * fraction.clamp(0.1, 0.9)
}
