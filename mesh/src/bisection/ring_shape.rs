//! The finitely many shapes of tetrahedra, up to place and size, and where each stands in its ring.
//!
//! Seen from the midpoint of its bisected edge, in units of the lattice spacing there, every
//! corner of a tetrahedron has coordinates −1, 0 or 1. All that a split looks up in the geometry
//! (the shapes of the halves, the directions of the next midpoints, the place in the ring)
//! therefore fits a table of a few dozen lines per TYPE, and no corner's coordinates are read.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use super::kuhn::{Point, ROOTS_PER_CELL, bisect, bisect_hull, bisected_corner, root_corners};

/// Corners as seen from the midpoint of the bisected edge.
type Offsets = [[i8; 3]; 4];

/// TYPE and offsets.
type Key = (u8, Offsets);

/// What a split needs to know of one shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RingShape {
    /// Shapes of the two halves.
    pub(crate) children: [u8; 2],
    /// Where the midpoints of the halves' bisected edges lie, as numbers of [`direction`].
    pub(crate) towards: [u8; 2],
    /// Place in the ring, 0..8.
    pub(crate) slot: u8,
    /// Which of the ring's older vertices (0..4) made this tetrahedron.
    pub(crate) dependency: u8,
}

/// The table of all shapes.
#[derive(Debug)]
pub(crate) struct RingShapes {
    keys: Vec<Key>,
    shapes: Vec<RingShape>,
    /// By TYPE and marks of the parent: [`bisect_hull`].
    hulls: [[[u8; 2]; 16]; 3],
}

/// The one table, made at first use.
pub(crate) static RING_SHAPES: LazyLock<RingShapes> = LazyLock::new(RingShapes::new);

/// Directions from a vertex to those that depend on it, by TYPE of the tetrahedra it bisects: the
/// six along the axes for TYPE0 and TYPE1, the eight along the diagonals for TYPE2.
pub(crate) const DIRECTIONS: [&[Point]; 3] = [&ALONG_AXES, &ALONG_AXES, &ALONG_DIAGONALS];

const ALONG_AXES: [Point; 6] =
    [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

const ALONG_DIAGONALS: [Point; 8] = [
    [-1, -1, -1],
    [1, -1, -1],
    [-1, 1, -1],
    [1, 1, -1],
    [-1, -1, 1],
    [1, -1, 1],
    [-1, 1, 1],
    [1, 1, 1],
];

/// The number of a direction in [`DIRECTIONS`].
fn direction(kind: u8, signs: [i8; 3]) -> u8 {
    let wanted = signs.map(i32::from);
    let known = DIRECTIONS[usize::from(kind)];
    known.iter().position(|&d| d == wanted).unwrap_or(known.len()) as u8
}

/// Twice the midpoint of the bisected edge.
fn doubled_midpoint(corners: &[Point; 4], kind: u8) -> Point {
    let (a, b) = (corners[0], corners[bisected_corner(kind)]);
    std::array::from_fn(|i| a[i] + b[i])
}

fn key(corners: &[Point; 4], kind: u8) -> Key {
    let middle = doubled_midpoint(corners, kind);
    // All components that are not 0 have the same magnitude: their sign is their value.
    let sign = |c: &Point| std::array::from_fn(|i| (2 * c[i] - middle[i]).signum() as i8);
    (kind, corners.each_ref().map(sign))
}

/// The halves of a shape and the directions of their midpoints.
fn halves((kind, offsets): &Key) -> [(Key, u8); 2] {
    let corners = offsets.map(|c| c.map(i32::from));
    bisect(&corners, *kind, [0; 3]).map(|half| {
        let next = (kind + 1) % 3;
        let signs = doubled_midpoint(&half, next).map(|c| c.signum() as i8);
        (key(&half, next), direction(*kind, signs))
    })
}

/// The corner that came last into a tetrahedron above the roots.
fn newest((kind, offsets): &Key) -> [i8; 3] {
    offsets[bisected_corner((kind + 2) % 3)]
}

impl RingShapes {
    fn new() -> Self {
        let mut found: BTreeSet<Key> = BTreeSet::new();
        let mut open: Vec<Key> = Vec::new();
        for cell in 0..8 {
            let cell = [cell & 1, cell >> 1 & 1, cell >> 2];
            open.extend((0..ROOTS_PER_CELL).map(|order| key(&root_corners(cell, order, 2), 0)));
        }
        while let Some(shape) = open.pop() {
            if found.insert(shape) {
                open.extend(halves(&shape).map(|(half, _)| half));
            }
        }
        let keys: Vec<Key> = found.into_iter().collect();
        let number = |wanted: &Key| keys.partition_point(|k| k < wanted);
        let shapes = keys
            .iter()
            .map(|shape| {
                // The ring around this shape's bisected edge: same TYPE, same first corner.
                let ring = || keys.iter().filter(|k| (k.0, k.1[0]) == (shape.0, shape.1[0]));
                let makers: BTreeSet<[i8; 3]> = ring().map(newest).collect();
                let [first, second] = halves(shape);
                RingShape {
                    children: [number(&first.0) as u8, number(&second.0) as u8],
                    towards: [first.1, second.1],
                    slot: ring().filter(|k| *k < shape).count() as u8,
                    dependency: makers.range(..newest(shape)).count() as u8,
                }
            })
            .collect();
        let hulls = [0, 1, 2].map(|kind| std::array::from_fn(|hull| bisect_hull(hull as u8, kind)));
        Self { keys, shapes, hulls }
    }

    /// The number of the shape of a tetrahedron with lattice corners; only for roots, whose
    /// descendants' shapes follow from the table.
    pub(crate) fn of_root(&self, corners: &[Point; 4]) -> u8 {
        let wanted = key(corners, 0);
        self.keys.partition_point(|k| *k < wanted) as u8
    }

    /// The shape of a number.
    #[inline]
    pub(crate) fn get(&self, number: u8) -> &RingShape {
        &self.shapes[usize::from(number)]
    }

    /// [`bisect_hull`], looked up.
    #[inline]
    pub(crate) fn bisect_hull(&self, hull: u8, level: u8) -> [u8; 2] {
        self.hulls[usize::from(level % 3)][usize::from(hull & 15)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tetrahedra around one bisected edge, inside a domain: 6, 4 or 8, by TYPE; they were
    /// made by 3, 2 or 4 older vertices, two each.
    #[test]
    fn rings_are_complete_and_slots_are_distinct() {
        let table = &*RING_SHAPES;
        for (i, shape) in table.keys.iter().enumerate() {
            let ring: Vec<usize> = (0..table.keys.len())
                .filter(|&j| (table.keys[j].0, table.keys[j].1[0]) == (shape.0, shape.1[0]))
                .collect();
            let size = [6, 4, 8][usize::from(shape.0)];
            assert_eq!(ring.len(), size, "{shape:?}");
            let slots: BTreeSet<u8> = ring.iter().map(|&j| table.shapes[j].slot).collect();
            assert_eq!(slots, (0..size as u8).collect(), "{shape:?}");
            for maker in 0..size / 2 {
                let made = ring.iter().filter(|&&j| table.shapes[j].dependency == maker as u8);
                assert_eq!(made.count(), 2, "{shape:?}");
            }
            assert!(usize::from(table.shapes[i].children[1]) < table.keys.len());
        }
    }

    #[test]
    fn offsets_are_unit_steps_and_edges_are_centred() {
        for (kind, offsets) in &RING_SHAPES.keys {
            let other = offsets[bisected_corner(*kind)];
            assert!((0..3).all(|i| offsets[0][i] == -other[i]));
            let length = offsets[0].iter().filter(|&&c| c != 0).count();
            assert_eq!(length, 3 - usize::from(*kind));
        }
    }
}
