//! What the forest keeps of one ring: everything a split or merge reads lies in one place.

use super::delta::{Tet, TetId, VertexId};
use super::kuhn::Point;
use super::label_tree::NodeRef;

/// No diamond, no vertex, no place in a list.
pub(crate) const NONE: u32 = u32::MAX;

/// Most tetrahedra around an edge.
pub(crate) const SLOTS: usize = 8;

/// The ring around an edge, known by the edge's midpoint.
///
/// A tetrahedron's number is 8 · diamond + slot, and its slot follows from its shape: a ring is
/// contiguous in memory and in an order that does not depend on history. Tetrahedra of the
/// finest level, which no edge of the lattice bisects, lie eight to a diamond that has no point.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Diamond {
    pub(crate) point: Point,
    /// The active vertex at `point`, or NONE.
    pub(crate) vertex: u32,
    /// The diamonds whose splits made the members, or NONE: the older vertices that a vertex
    /// here depends on, as far as they are active.
    pub(crate) dependencies: [u32; 4],
    /// Where the map of points keeps this diamond.
    pub(crate) place: usize,
    /// Position in the list of open diamonds (those whose members are leaves), or NONE.
    pub(crate) open_at: u32,
    /// Level of the members.
    pub(crate) level: u8,
    /// Bit i: slot i holds a tetrahedron.
    pub(crate) members: u8,
    /// Active vertices that depend on the one here.
    pub(crate) active_dependents: u8,
    pub(crate) tets: [TetRecord; SLOTS],
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct TetRecord {
    pub(crate) vertices: [VertexId; 4],
    pub(crate) node: NodeRef,
    /// Numbers of the halves while the ring is split.
    pub(crate) children: [u32; 2],
    pub(crate) level: u8,
    /// Bit i: the face opposite corner i lies on the domain's hull.
    pub(crate) hull: u8,
    /// Number in the table of shapes.
    pub(crate) shape: u8,
}

impl TetRecord {
    /// What an empty slot holds; never read.
    const VACANT: Self = Self {
        vertices: [VertexId(NONE); 4],
        node: NodeRef::VOID,
        children: [NONE; 2],
        level: 0,
        hull: 0,
        shape: 0,
    };

    /// The tetrahedron as others see it.
    #[inline]
    pub(crate) fn tet(&self, id: u32) -> Tet {
        Tet { id: TetId(id), vertices: self.vertices, level: self.level, node: self.node }
    }
}

impl Diamond {
    /// A diamond without members.
    pub(crate) fn new(point: Point, place: usize, level: u8) -> Self {
        Self {
            point,
            vertex: NONE,
            dependencies: [NONE; 4],
            place,
            open_at: NONE,
            level,
            members: 0,
            active_dependents: 0,
            tets: [TetRecord::VACANT; SLOTS],
        }
    }

    /// Makes a diamond that went out of use a new one; the slots need no cleaning, and
    /// its dependents have gone before it.
    #[inline]
    pub(crate) fn renew(&mut self, point: Point, place: usize, level: u8) {
        self.point = point;
        self.vertex = NONE;
        self.dependencies = [NONE; 4];
        self.place = place;
        self.level = level;
        self.members = 0;
    }

    /// How many older vertices have made members.
    #[inline]
    pub(crate) fn makers(&self) -> usize {
        self.dependencies.iter().filter(|&&d| d != NONE).count()
    }
}

/// Number of the tetrahedron in a slot.
#[inline]
pub(crate) fn tet_number(diamond: u32, slot: usize) -> u32 {
    diamond * SLOTS as u32 + slot as u32
}

/// Diamond and slot of a tetrahedron.
#[inline]
pub(crate) fn tet_place(number: u32) -> (usize, usize) {
    (number as usize / SLOTS, number as usize % SLOTS)
}

/// The slots that hold a tetrahedron, ascending.
#[inline]
pub(crate) fn occupied(mut members: u8) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let slot = members.trailing_zeros() as usize;
        (members != 0).then(|| {
            members &= members - 1;
            slot
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_fills_five_cache_lines() {
        assert_eq!(size_of::<TetRecord>(), 32);
        assert_eq!(size_of::<Diamond>(), 5 * 64);
    }

    #[test]
    fn occupied_slots_come_in_order() {
        assert_eq!(occupied(0b1010_0001).collect::<Vec<_>>(), [0, 5, 7]);
        assert_eq!(occupied(0).count(), 0);
        assert_eq!(tet_place(tet_number(3, 5)), (3, 5));
    }
}
