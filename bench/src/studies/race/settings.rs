//! What a race is asked for: sizes, families of rings, methods, limits.

use serde::Serialize;
use yawara_inverse_update::CHOICES;

use crate::solvers::direct::{DIRECT, Direct};

/// Rings of one kind, by the homogenisation that makes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Family {
    pub name: &'static str,
    pub homogenisation: &'static str,
}

/// Rank 3 everywhere; rank 3 in homogeneous rings and up to 21 in others.
pub(crate) const FAMILIES: [Family; 2] = [
    Family { name: "rank3", homogenisation: "linear" },
    Family { name: "laminate", homogenisation: "laminate" },
];

/// Pairs of a burst that count; one more comes first and does not.
pub(crate) const BURST: usize = 5;

/// What is to be measured.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Free vertices, ascending.
    pub vertices: Vec<usize>,
    pub direct: &'static [Direct],
    /// Pairs of a split and a merge that are timed, in whole bursts.
    pub pairs: usize,
    /// Seconds that one method may take at one size, in one family.
    pub cap_s: f64,
    /// Bytes that one method may hold.
    pub memory_bytes: f64,
    pub seed: u64,
}

impl Settings {
    /// Bursts that all pairs make.
    pub fn bursts(&self) -> usize {
        self.pairs.div_ceil(BURST)
    }
}

/// A method that was not measured at a size, and why.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LeftOut {
    pub vertices: usize,
    pub method: &'static str,
    pub family: &'static str,
    pub reason: String,
}

/// Names of [`CHOICES`] that are updated: the others are direct methods by themselves.
pub(crate) fn maintainers() -> impl Iterator<Item = &'static str> {
    CHOICES.iter().copied().filter(|name| DIRECT.iter().all(|direct| direct.name() != *name))
}

/// True for methods that don't hold n² numbers.
pub(crate) fn is_sparse(name: &str) -> bool {
    name.starts_with("sparse")
}
