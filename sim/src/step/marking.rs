//! Which vertices are wanted: above a threshold, or until the error is what was asked for.

use yawara_mesh::Point;

use crate::scene::Refinement;

/// A vertex that may come in and its indicator.
pub(crate) struct Wish {
    pub point: Point,
    pub value: f64,
}

/// Where indicators ask for something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// A vertex comes in above it.
    pub split_above: f64,
    /// A vertex goes out at or below it.
    pub merge_below: f64,
}

impl Refinement {
    /// The limits for `wishes`. With a target τ the largest are taken until the rest of them has the
    /// error τE (bulk marking: Dörfler, SIAM J. Numer. Anal. 33(3), 1996); a vertex goes out that has less than a fraction of the
    /// mean share of it. `whole` is what indicators of an error of E add up to, where they are energies.
    pub(crate) fn limits(&self, wishes: &[Wish], whole: Option<f64>) -> Limits {
        let (None, Some(whole)) = (self.split_above, whole) else {
            let split_above = self.split_above.unwrap_or(f64::INFINITY);
            return Limits { split_above, merge_below: self.merge_fraction * split_above };
        };
        let mut values: Vec<f64> = wishes.iter().map(|wish| wish.value).collect();
        values.sort_unstable_by(f64::total_cmp);
        let allowed = self.target * whole;
        let mut below = 0.0;
        let left = values.iter().take_while(|&&value| {
            below += value;
            below <= allowed
        });
        let split_above = left.last().copied().unwrap_or(0.0);
        let merge_below = self.merge_fraction * allowed / values.len().max(1) as f64;
        Limits { split_above, merge_below }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(values: &[f64], refinement: Refinement, whole: Option<f64>) -> Limits {
        let wish = |(i, &value): (usize, &f64)| Wish { point: [i as i32, 0, 0], value };
        let wishes: Vec<Wish> = values.iter().enumerate().map(wish).collect();
        refinement.limits(&wishes, whole)
    }

    #[test]
    fn the_largest_are_taken_until_the_rest_is_what_was_asked_for() {
        let asked = |target| Refinement { target, merge_fraction: 0.5, ..Refinement::default() };
        let values = [1.0, 8.0, 2.0, 4.0];
        // The rest may be 7.5: 1 + 2 + 4.
        let found = limits(&values, asked(0.5), Some(15.0));
        assert_eq!(found, Limits { split_above: 4.0, merge_below: 0.5 * 7.5 / 4.0 });
        // All of it is little enough.
        assert_eq!(limits(&values, asked(0.5), Some(30.0)).split_above, 8.0);
        // Nothing is.
        assert_eq!(limits(&values, asked(0.01), Some(15.0)).split_above, 0.0);
        assert_eq!(limits(&[], asked(0.1), Some(0.0)).merge_below, 0.0);
    }

    #[test]
    fn a_threshold_goes_before_a_target() {
        let rules = || Refinement { merge_fraction: 0.5, ..Refinement::default() };
        let above = Refinement { split_above: Some(3.0), ..rules() };
        let want = Limits { split_above: 3.0, merge_below: 1.5 };
        assert_eq!(limits(&[9.0], above, Some(1.0)), want);
        let want = Limits { split_above: f64::INFINITY, merge_below: f64::INFINITY };
        assert_eq!(limits(&[9.0], rules(), None), want);
    }
}
