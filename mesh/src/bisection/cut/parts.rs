//! What hangs together inside one tetrahedron.

use std::collections::{HashMap, VecDeque};

use super::fine::{FineFace, FineTet};
use crate::union_find::groups;

/// The number of the part that each finest tetrahedron belongs to: parts in the order of their first one. What is void
/// goes with the solid part that it hangs on to, void that hangs on nothing with the first part.
///
/// A tetrahedron without any material is one part. Cost: O(n log n).
pub(super) fn parts(fine: &[FineTet], is_severed: impl Fn(FineFace) -> bool) -> Vec<u16> {
    let contacts = contacts(fine, is_severed);
    let solid = contacts.iter().filter(|pair| pair.iter().all(|&i| fine[i as usize].is_solid()));
    let mut part_of = vec![None; fine.len()];
    let joined = groups(fine.len(), solid.copied());
    let bodies = joined.iter().filter(|group| fine[group[0]].is_solid());
    for (number, group) in bodies.enumerate() {
        group.iter().for_each(|&i| part_of[i] = Some(number as u16));
    }
    let mut beside = vec![Vec::new(); fine.len()];
    for &[a, b] in &contacts {
        beside[a as usize].push(b as usize);
        beside[b as usize].push(a as usize);
    }
    let mut reached: VecDeque<usize> = (0..fine.len()).filter(|&i| part_of[i].is_some()).collect();
    while let Some(at) = reached.pop_front() {
        for &next in &beside[at] {
            if part_of[next].is_none() {
                part_of[next] = part_of[at];
                reached.push_back(next);
            }
        }
    }
    part_of.into_iter().map(|part| part.unwrap_or(0)).collect()
}

/// The pairs that touch in a face that is not severed.
fn contacts(fine: &[FineTet], is_severed: impl Fn(FineFace) -> bool) -> Vec<[u32; 2]> {
    let mut open: HashMap<FineFace, u32> = HashMap::with_capacity(2 * fine.len());
    let mut contacts = Vec::with_capacity(2 * fine.len());
    for (i, tet) in (0..).zip(fine) {
        for face in tet.faces {
            match open.remove(&face) {
                Some(other) if !is_severed(face) => contacts.push([other, i]),
                Some(_) => {}
                None => {
                    open.insert(face, i);
                }
            }
        }
    }
    contacts
}
