//! Everything measured at one size.

use super::competitor::Competitor;
use super::memory::Memory;
use super::row::Row;
use super::samples::ratio;
use super::settings::{FAMILIES, LeftOut};
use crate::harness::statistics::median;

/// Everything measured at one size.
#[derive(Default)]
pub(crate) struct AtSize {
    pub vertices: usize,
    pub rows: Vec<Row>,
    pub competitors: Vec<Competitor>,
    pub left_out: Vec<LeftOut>,
    pub memory: Memory,
}

/// The rows of all sizes.
pub(crate) fn rows(sizes: &[AtSize]) -> Vec<Row> {
    sizes.iter().flat_map(|size| size.rows.iter().cloned()).collect()
}

impl AtSize {
    /// The name of a competitor's family.
    pub fn family(&self, competitor: &Competitor) -> &'static str {
        FAMILIES[competitor.workload].name
    }

    pub fn competitor(&self, name: &str, family: &str) -> Option<&Competitor> {
        self.competitors.iter().find(|one| one.name == name && self.family(one) == family)
    }

    /// Time of a split by `slow` over that by `fast`, and whether `slow` is extrapolated.
    pub fn over(&self, slow: &str, fast: &str, family: &str) -> Option<(f64, bool)> {
        let fast = &self.competitor(fast, family)?.split;
        if let Some(slow) = self.competitor(slow, family) {
            return Some((ratio(&slow.split, fast), false));
        }
        let row = self.rows.iter().find(|row| row.method == slow && row.family == family)?;
        Some((row.split_ms.p50 / median(&fast.all()), true))
    }
}
