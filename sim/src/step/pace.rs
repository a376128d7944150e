//! The parts in which a step is made where the whole does not converge.

use super::span::Span;

/// How many parts in a row have to converge before a longer one is tried.
const PROVEN: usize = 2;

/// How long parts are, kept from step to step.
pub(super) struct Pace {
    /// The longest part to try, s; infinite for whole steps.
    length: f64,
    /// Parts that have converged since it last changed.
    proven: usize,
    /// The shortest part as a fraction of a step.
    shortest: f64,
}

impl Pace {
    /// Whole steps, which may be halved `halvings` times.
    pub fn new(halvings: u32) -> Self {
        Self { length: f64::INFINITY, proven: 0, shortest: 0.5f64.powi(halvings as i32) }
    }

    /// How long parts are, s, and how many in a row have converged.
    pub fn kept(&self) -> (f64, usize) {
        (self.length, self.proven)
    }

    /// Goes on from what was kept.
    pub fn resume(&mut self, (length, proven): (f64, usize)) {
        (self.length, self.proven) = (length, proven);
    }

    /// The next part of `step`, from where the body is now. What would be left of the step after it is
    /// never shorter than half a part.
    pub fn next(&self, from: f64, step: Span) -> Span {
        let to = from + self.length;
        let to = if step.to - to > 0.5 * self.length { to } else { step.to };
        Span { from, to }
    }

    /// A part has converged.
    pub fn succeed(&mut self) {
        self.proven += 1;
        if self.proven >= PROVEN {
            self.proven = 0;
            self.length *= 2.0;
        }
    }

    /// The body is at the end of the step by another way: nothing is known of how long parts from there may be.
    pub fn begin_anew(&mut self) {
        (self.length, self.proven) = (f64::INFINITY, 0);
    }

    /// A part has not: the next one is half as long. False where it was as short as a part of `step` may
    /// be.
    pub fn fail(&mut self, part: Span, step: Span) -> bool {
        let length = part.to - part.from;
        self.proven = 0;
        if length <= 1.5 * self.shortest * (step.to - step.from) {
            return false;
        }
        self.length = 0.5 * length;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Span = Span { from: 1.0, to: 2.0 };

    #[test]
    fn parts_halve_until_they_converge_and_grow_again() {
        let mut pace = Pace::new(3);
        assert_eq!(pace.next(1.0, STEP), STEP);
        for want in [0.5, 0.25, 0.125] {
            assert!(pace.fail(pace.next(1.0, STEP), STEP));
            assert_eq!(pace.next(1.0, STEP).to, 1.0 + want);
        }
        let mut from = 1.0;
        for want in [1.125, 1.25, 1.5, 1.75, 2.0] {
            let part = pace.next(from, STEP);
            assert_eq!((part.from, part.to), (from, want));
            (from, _) = (part.to, pace.succeed());
        }
        let next = Span { from: 2.0, to: 3.0 };
        assert_eq!(pace.next(2.0, next).to, 2.5, "the next step begins as this one ended");
        assert!((0..2).all(|_| pace.fail(pace.next(2.0, next), next)));
        assert!(!pace.fail(pace.next(2.0, next), next), "an eighth is the shortest");
    }

    #[test]
    fn nothing_short_is_left_at_the_end_of_a_step() {
        let mut pace = Pace::new(8);
        assert!(pace.fail(STEP, STEP));
        assert_eq!(pace.next(1.3, STEP).to, 2.0, "half a part more");
        assert!(!Pace::new(0).fail(STEP, STEP), "no parts");
    }
}
