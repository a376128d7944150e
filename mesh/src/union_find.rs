//! Connected components by union-find.

/// The root of an entry's tree; halves the path to it.
pub(crate) fn root(parents: &mut [u32], mut entry: u32) -> u32 {
    while parents[entry as usize] != entry {
        parents[entry as usize] = parents[parents[entry as usize] as usize];
        entry = parents[entry as usize];
    }
    entry
}
