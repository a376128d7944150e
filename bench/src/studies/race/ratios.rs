//! Who is how much faster than whom.

use serde::Serialize;

use super::{Field, Lane, Samples, ratio};
use crate::statistics::median;

/// Most of a memory pass that is left to compute with.
const STREAMING: Limit = Limit { at_most: true, value: 1.4, from: 1024, family: "rank3" };
const DENSE: Limit = Limit { at_most: false, value: 100.0, from: 1024, family: "rank3" };
const PEER: Limit = Limit { at_most: false, value: 25.0, from: 2048, family: "rank3" };
const SPARSITY: Limit = Limit { at_most: false, value: 20.0, from: 2048, family: "rank3" };
const RANK: Limit = Limit { at_most: true, value: 6.0, from: 2048, family: "laminate" };
/// Of smaller sizes half of C fits into a cache, which a copy uses differently.
const MEMORY: Limit = Limit { at_most: true, value: 1.0 / 0.9, from: 1024, family: "rank3" };

/// What a ratio should be, from a number of vertices on and in one family.
#[derive(Clone, Copy, Debug)]
struct Limit {
    at_most: bool,
    value: f64,
    from: usize,
    family: &'static str,
}

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

/// Time of a split, or of what stands in for it.
enum Side<'a> {
    Measured(&'a Samples),
    Extrapolated(f64),
}

/// All ratios of one size.
pub(crate) fn ratios(field: &Field) -> Vec<Ratio> {
    let mut found = Vec::new();
    let mut add = |family, name: String, value: Option<(f64, bool)>, limit: Option<Limit>| {
        if let Some((value, extrapolated)) = value.filter(|(value, _)| value.is_finite()) {
            found.push(Ratio::new(field.vertices, family, name, (value, extrapolated), limit));
        }
    };
    for family in super::FAMILIES.map(|family| family.name) {
        for (lane, course) in field.lanes.iter().map(|lane| (lane, field.family(lane))) {
            if course == family && lane.name.starts_with("woodbury") {
                let limit = (lane.precision() == "f64").then_some(STREAMING);
                let [bound, cold_bound] = field.memory.bound(lane.precision());
                let value = Some((ratio(&lane.split, bound), false));
                add(family, format!("{} / bound", lane.name), value, limit);
                let value = Some((ratio(&lane.cold_split, cold_bound), false));
                add(family, format!("{} / bound, cold", lane.name), value, None);
            }
        }
        for (slow, fast, limit) in [
            ("cholesky", "woodbury", Some(DENSE)),
            ("lu", "woodbury", None),
            ("paper", "woodbury", None),
            ("sparse_refactor_amd", "sparse", Some(PEER)),
            ("sparse_refactor_nd", "sparse", None),
            ("woodbury", "sparse", Some(SPARSITY)),
        ] {
            add(family, format!("{slow} / {fast}"), field.over(slow, fast, family), limit);
        }
    }
    let [rank3, laminate] = super::FAMILIES.map(|family| field.lane("sparse", family.name));
    let value = rank3.zip(laminate).map(|(a, b)| (ratio(&b.split, &a.split), false));
    add("laminate", "sparse laminate / sparse rank3".into(), value, Some(RANK));
    let value = Some((ratio(&field.memory.pass, &field.memory.copy), false));
    add("rank3", "bound / memcpy".into(), value, Some(MEMORY));
    found
}

impl Field {
    /// The name of a lane's family.
    fn family(&self, lane: &Lane) -> &'static str {
        super::FAMILIES[lane.course].name
    }

    fn lane(&self, name: &str, family: &str) -> Option<&Lane> {
        self.lanes.iter().find(|lane| lane.name == name && self.family(lane) == family)
    }

    fn side(&self, name: &str, family: &str) -> Option<Side<'_>> {
        if let Some(lane) = self.lane(name, family) {
            return Some(Side::Measured(&lane.split));
        }
        let row = self.rows.iter().find(|row| row.method == name && row.family == family)?;
        Some(Side::Extrapolated(row.split_ms.p50))
    }

    /// Time of `slow` over that of `fast`, and whether it is extrapolated.
    fn over(&self, slow: &str, fast: &str, family: &str) -> Option<(f64, bool)> {
        let Side::Measured(fast) = self.side(fast, family)? else { return None };
        match self.side(slow, family)? {
            Side::Measured(slow) => Some((ratio(slow, fast), false)),
            Side::Extrapolated(slow) => Some((slow / median(&fast.all()), true)),
        }
    }
}

impl Ratio {
    fn new(
        vertices: usize,
        family: &'static str,
        name: String,
        (value, extrapolated): (f64, bool),
        limit: Option<Limit>,
    ) -> Self {
        let limit = limit.filter(|l| l.family == family && vertices >= l.from);
        let claim = limit.map(|l| {
            let sign = if l.at_most { "≤" } else { "≥" };
            format!("{sign} {}", (l.value * 100.0).round() / 100.0)
        });
        let holds = limit.map(|l| if l.at_most { value <= l.value } else { value >= l.value });
        Self { vertices, family, name, value, extrapolated, claim, holds }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_is_made_where_it_was_meant_and_can_fail() {
        let of = |vertices, family, value| {
            Ratio::new(vertices, family, "a / b".into(), (value, false), Some(STREAMING))
        };
        assert_eq!(of(1023, "rank3", 9.0).holds, None);
        assert_eq!(of(1024, "laminate", 9.0).holds, None);
        assert_eq!(of(1024, "rank3", 1.4).holds, Some(true));
        let failed = of(4000, "rank3", 1.5);
        assert_eq!((failed.holds, failed.claim.as_deref()), (Some(false), Some("≤ 1.4")));
        let peer = Ratio::new(2048, "rank3", "a / b".into(), (24.9, true), Some(PEER));
        assert_eq!((peer.holds, peer.claim.as_deref()), (Some(false), Some("≥ 25")));
    }
}
