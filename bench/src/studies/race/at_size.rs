//! Everything measured at one size.

use super::competitor::Competitor;
use super::memory::Memory;
use super::row::Row;
use super::samples::{Samples, ratio};
use super::settings::{FAMILIES, LeftOut};
use crate::harness::statistics::median;

/// Everything measured at one size.
pub(crate) struct AtSize {
    pub vertices: usize,
    pub rows: Vec<Row>,
    pub competitors: Vec<Competitor>,
    pub left_out: Vec<LeftOut>,
    pub memory: Memory,
}

/// Time of a split, or of what stands in for it.
enum Side<'a> {
    Measured(&'a Samples),
    Extrapolated(f64),
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
        self.competitors
            .iter()
            .find(|competitor| competitor.name == name && self.family(competitor) == family)
    }

    fn side(&self, name: &str, family: &str) -> Option<Side<'_>> {
        if let Some(competitor) = self.competitor(name, family) {
            return Some(Side::Measured(&competitor.split));
        }
        let row = self.rows.iter().find(|row| row.method == name && row.family == family)?;
        Some(Side::Extrapolated(row.split_ms.p50))
    }

    /// Time of `slow` over that of `fast`, and whether it is extrapolated.
    pub fn over(&self, slow: &str, fast: &str, family: &str) -> Option<(f64, bool)> {
        let Side::Measured(fast) = self.side(fast, family)? else { return None };
        match self.side(slow, family)? {
            Side::Measured(slow) => Some((ratio(slow, fast), false)),
            Side::Extrapolated(slow) => Some((slow / median(&fast.all()), true)),
        }
    }
}
