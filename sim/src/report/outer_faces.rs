//! The outside of the tetrahedra of a frame.

use std::collections::HashMap;

use super::records::Frame;

/// The faces of only one tetrahedron, counter-clockwise as seen from outside, ascending, with its number.
pub(crate) fn outer_faces(frame: &Frame) -> Vec<([u32; 3], usize)> {
    let mut found: HashMap<[u32; 3], Option<([u32; 3], usize)>> = HashMap::new();
    for (number, &[a, b, c, d]) in frame.tets.iter().enumerate() {
        for face in [[a, c, b], [a, b, d], [a, d, c], [b, c, d]] {
            let mut key = face;
            key.sort_unstable();
            found.entry(key).and_modify(|both| *both = None).or_insert(Some((face, number)));
        }
    }
    let mut outer: Vec<_> = found.into_values().flatten().collect();
    outer.sort_unstable();
    outer
}
