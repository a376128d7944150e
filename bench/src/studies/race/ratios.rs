//! Everything measured at one size, and who is how much faster than whom.

use serde::Serialize;

use super::competitor::Competitor;
use super::memory::Memory;
use super::row::Row;
use super::samples::ratio;
use super::settings::{FAMILIES, LeftOut};
use crate::harness::report::Limit;
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
    pub fn competitor(&self, name: &str, family: &str) -> Option<&Competitor> {
        self.competitors.iter().find(|one| one.name == name && one.family() == family)
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

/// A limit that is claimed from so many vertices on, in one family.
type Bar = Option<(Limit, usize, &'static str)>;

/// Most of a memory pass that is left to compute with.
const STREAMING: Bar = Some((Limit::AtMost(1.4), 1024, "rank3"));
const DENSE: Bar = Some((Limit::AtLeast(100.0), 1024, "rank3"));
const PEER: Bar = Some((Limit::AtLeast(25.0), 2048, "rank3"));
const SPARSITY: Bar = Some((Limit::AtLeast(20.0), 2048, "rank3"));
const RANK: Bar = Some((Limit::AtMost(6.0), 2048, "laminate"));
/// Of smaller sizes half of C fits into a cache, which a copy uses differently.
const MEMORY: Bar = Some((Limit::AtMost(1.0 / 0.9), 1024, "rank3"));

/// A ratio of times of the same updates, in the same bursts.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Ratio {
    pub vertices: usize,
    pub family: &'static str,
    pub name: String,
    pub value: f64,
    /// One side is extrapolated.
    pub extrapolated: bool,
    /// What it should be, where anything is claimed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub claim: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holds: Option<bool>,
}

/// All ratios of one size.
fn ratios(size: &AtSize) -> Vec<Ratio> {
    let mut found = Vec::new();
    let mut add = |family, name: String, value: Option<(f64, bool)>, bar: Bar| {
        if let Some(value) = value.filter(|(value, _)| value.is_finite()) {
            found.push(Ratio::new(size.vertices, family, name, value, bar));
        }
    };
    for family in FAMILIES.map(|family| family.name) {
        for competitor in size.competitors.iter().filter(|one| one.family() == family) {
            if competitor.name.starts_with("woodbury") {
                let bar = STREAMING.filter(|_| competitor.precision() == "f64");
                let [bound, cold_bound] = size.memory.bound(competitor.precision());
                let value = Some((ratio(&competitor.split, bound), false));
                add(family, format!("{} / bound", competitor.name), value, bar);
                let value = Some((ratio(&competitor.cold_split, cold_bound), false));
                add(family, format!("{} / bound, cold", competitor.name), value, None);
            }
        }
        for (slow, fast, bar) in [
            ("cholesky", "woodbury", DENSE),
            ("lu", "woodbury", None),
            ("paper", "woodbury", None),
            ("sparse_refactor_amd", "sparse", PEER),
            ("sparse_refactor_nd", "sparse", None),
            ("woodbury", "sparse", SPARSITY),
        ] {
            add(family, format!("{slow} / {fast}"), size.over(slow, fast, family), bar);
        }
    }
    let [rank3, laminate] = FAMILIES.map(|family| size.competitor("sparse", family.name));
    let value = rank3.zip(laminate).map(|(a, b)| (ratio(&b.split, &a.split), false));
    add("laminate", "sparse laminate / sparse rank3".into(), value, RANK);
    let value = Some((ratio(&size.memory.pass, &size.memory.copy), false));
    add("rank3", "bound / memcpy".into(), value, MEMORY);
    found
}

/// What goes beside the rows of a report: the ratios, and the methods that are missing.
pub(crate) fn beside(sizes: &[AtSize]) -> (Vec<Ratio>, Vec<LeftOut>) {
    let left_out = sizes.iter().flat_map(|size| size.left_out.iter().cloned());
    (sizes.iter().flat_map(ratios).collect(), left_out.collect())
}

impl Ratio {
    fn new(
        vertices: usize,
        family: &'static str,
        name: String,
        (value, extrapolated): (f64, bool),
        bar: Bar,
    ) -> Self {
        let limit = bar.filter(|(_, from, of)| *of == family && vertices >= *from);
        let claim = limit.map(|(limit, ..)| limit.text());
        let holds = limit.map(|(limit, ..)| limit.holds(value));
        Self { vertices, family, name, value, extrapolated, claim, holds }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_is_made_where_it_was_meant_and_can_fail() {
        let of = |vertices, family, value| {
            Ratio::new(vertices, family, "a / b".into(), (value, false), STREAMING)
        };
        assert_eq!(of(1023, "rank3", 9.0).holds, None);
        assert_eq!(of(1024, "laminate", 9.0).holds, None);
        assert_eq!(of(1024, "rank3", 1.4).holds, Some(true));
        let failed = of(4000, "rank3", 1.5);
        assert_eq!((failed.holds, failed.claim.as_deref()), (Some(false), Some("≤ 1.4")));
        let peer = Ratio::new(2048, "rank3", "a / b".into(), (24.9, true), PEER);
        assert_eq!((peer.holds, peer.claim.as_deref()), (Some(false), Some("≥ 25")));
    }
}
