//! What hangs together inside one tetrahedron.

use std::collections::{BTreeMap, VecDeque};

use super::fine::{FineFace, FineTet};
use crate::bisection::geometry::FACES;
use crate::bisection::kuhn::Point;
use crate::union_find::roots;

/// How the finest tetrahedra in a leaf lie to each other: the same in all leaves of a level.
pub(super) struct Facing {
    /// Pairs with a face in common, and which of the second's it is, in the order of the second and of its faces.
    inner: Vec<([u32; 2], usize)>,
    /// By the corner of the leaf opposite those on its border, and which of their faces is there.
    pub(super) outer: [Vec<(u32, usize)>; 4],
}

impl Facing {
    /// That of a leaf with these corners on the lattice of the finest level. Cost: O(n log n).
    pub(super) fn new(fine: &[FineTet], corners: &[Point; 4]) -> Self {
        let mut open: BTreeMap<FineFace, (u32, usize)> = BTreeMap::new();
        let mut inner = Vec::with_capacity(2 * fine.len());
        for (i, tet) in (0..).zip(fine) {
            for (side, face) in tet.faces.into_iter().enumerate() {
                match open.remove(&face) {
                    Some((other, _)) => inner.push(([other, i], side)),
                    None => drop(open.insert(face, (i, side))),
                }
            }
        }
        let mut outer: [Vec<(u32, usize)>; 4] = Default::default();
        for (face, place) in open {
            let at = FACES.iter().position(|side| face.is_in(side.map(|i| corners[i])));
            outer[at.unwrap_or_default()].push(place);
        }
        Self { inner, outer }
    }

    /// The pairs of tetrahedra that touch in a face that is not severed.
    fn contacts<'a>(
        &'a self,
        fine: &'a [FineTet],
        is_severed: impl Fn(FineFace) -> bool + 'a,
    ) -> impl Iterator<Item = [u32; 2]> + 'a {
        let whole =
            move |&&([_, b], side): &&([u32; 2], usize)| !is_severed(fine[b as usize].faces[side]);
        self.inner.iter().filter(whole).map(|(pair, _)| *pair)
    }

    /// The part of each finest tetrahedron with material: parts in the order of their first one.
    pub(super) fn solid_parts(
        &self,
        fine: &[FineTet],
        is_severed: impl Fn(FineFace) -> bool,
    ) -> Vec<Option<u16>> {
        let contacts = self.contacts(fine, is_severed);
        let solid = contacts.filter(|pair| pair.iter().all(|&i| fine[i as usize].is_solid()));
        let mut part_of: Vec<Option<u16>> = vec![None; fine.len()];
        let mut count = 0;
        for (i, root) in roots(fine.len(), solid).into_iter().enumerate() {
            if !fine[i].is_solid() {
                continue;
            }
            if root as usize == i {
                part_of[i] = Some(count);
                count += 1;
            } else {
                part_of[i] = part_of[root as usize];
            }
        }
        part_of
    }

    /// The number of the part that each finest tetrahedron belongs to. What is void goes with the solid part that it hangs
    /// on to, void that hangs on nothing with the first part.
    ///
    /// A tetrahedron without any material is one part. Cost: O(n).
    pub(super) fn parts(
        &self,
        fine: &[FineTet],
        is_severed: impl Fn(FineFace) -> bool,
    ) -> Vec<u16> {
        let mut part_of = self.solid_parts(fine, &is_severed);
        let mut beside = vec![Vec::new(); fine.len()];
        for [a, b] in self.contacts(fine, is_severed) {
            beside[a as usize].push(b as usize);
            beside[b as usize].push(a as usize);
        }
        let mut reached: VecDeque<usize> =
            (0..fine.len()).filter(|&i| part_of[i].is_some()).collect();
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
}
