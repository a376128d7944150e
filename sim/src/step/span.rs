//! A step or a part of one, in time.

/// From one time to another, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub from: f64,
    pub to: f64,
}

impl Span {
    /// The fraction of the span that lies after `t`.
    pub fn left_at(self, t: f64) -> f64 {
        (self.to - t) / (self.to - self.from)
    }
}
