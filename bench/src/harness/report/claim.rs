//! What is claimed of a figure.

use serde::Serialize;

/// A figure, what is claimed of it, and whether that holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// The figure's name.
    pub name: String,
    /// The figure; none where the claim is of several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// What it should be.
    pub claim: String,
    /// Whether it is; NaN is not.
    pub holds: bool,
}

/// The side of a limit that a figure should be on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Limit {
    AtMost(f64),
    AtLeast(f64),
}

impl Limit {
    /// `≤ 1.4`, `≥ 25`.
    pub fn text(self) -> String {
        let (sign, limit) = match self {
            Self::AtMost(limit) => ("≤", limit),
            Self::AtLeast(limit) => ("≥", limit),
        };
        format!("{sign} {}", (limit * 100.0).round() / 100.0)
    }

    /// Whether a figure is on that side.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
        }
    }
}

impl Claim {
    /// A figure against its limit.
    pub(crate) fn new(name: impl Into<String>, value: f64, limit: Limit) -> Self {
        let (claim, holds) = (limit.text(), limit.holds(value));
        Self { name: name.into(), value: Some(value), claim, holds }
    }

    /// A line of a list.
    pub(crate) fn text(&self) -> String {
        let Self { name, value, claim, holds } = self;
        let value = value.map_or_else(String::new, |value| format!("{value:.2}, "));
        let verdict = if *holds { "holds" } else { "does NOT hold" };
        format!("- {name}: {value}claimed {claim}: {verdict}\n")
    }
}
