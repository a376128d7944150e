//! Connected components by union-find.

use std::collections::BTreeMap;

/// The groups of 0..`count` that `pairs` join, each ascending, in the order of their first.
///
/// Cost: O(n log n).
pub(crate) fn groups(count: usize, pairs: impl Iterator<Item = [u32; 2]>) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (entry, first) in roots(count, pairs).into_iter().enumerate() {
        groups.entry(first).or_default().push(entry);
    }
    groups.into_values().collect()
}

/// The first of the group of each of 0..`count`. Cost: O(n log n).
pub(crate) fn roots(count: usize, pairs: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for pair in pairs {
        let [a, b] = pair.map(|entry| root(&mut parents, entry));
        // The smaller one stays root: the first of its group.
        parents[a.max(b) as usize] = a.min(b);
    }
    (0..count as u32).map(|entry| root(&mut parents, entry)).collect()
}

/// The root of an entry's tree; halves the path to it.
fn root(parents: &mut [u32], mut entry: u32) -> u32 {
    while parents[entry as usize] != entry {
        parents[entry as usize] = parents[parents[entry as usize] as usize];
        entry = parents[entry as usize];
    }
    entry
}
