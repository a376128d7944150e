//! Cuts by planes.

use std::collections::BTreeMap;

use proptest::prelude::*;
use yawara_mesh::{BisectionForest, FineFace, Point, Severed, TetId};

/// A plane by its normal and offset, and the ball that it is cut in by its middle and radius, in units of a quarter of
/// those of the finest lattice.
pub type Cut = ([i32; 3], i32, (Point, i32));

/// The faces between finest tetrahedra whose middles (four times, in finest units) a surface parts.
pub fn parted(forest: &BisectionForest, parts: impl Fn(Point, Point) -> bool) -> Vec<Severed> {
    let mut open: BTreeMap<FineFace, (TetId, Point)> = BTreeMap::new();
    let mut found = Vec::new();
    for leaf in forest.leaves().filter(|leaf| forest.leaf_of(leaf.id) == leaf.id) {
        for fine in forest.finest_in(&leaf) {
            let middle = [0, 1, 2].map(|axis| fine.corners.iter().map(|c| c[axis]).sum());
            for face in fine.faces {
                match open.remove(&face) {
                    Some((other, there)) if parts(there, middle) => {
                        found.push(Severed { face, leaves: [other, leaf.id] });
                    }
                    Some(_) => {}
                    None => {
                        open.insert(face, (leaf.id, middle));
                    }
                }
            }
        }
    }
    found
}

/// Whether two middles lie on different sides of the plane n·x = d, within a ball.
pub fn by_plane(n: [i32; 3], d: i32, ball: (Point, i32)) -> impl Fn(Point, Point) -> bool {
    let side = move |p: Point| (0..3).map(|i| n[i] * p[i]).sum::<i32>() > d;
    let near =
        move |p: Point| (0..3).map(|i| (p[i] - ball.0[i]).pow(2)).sum::<i32>() < ball.1 * ball.1;
    move |a, b| side(a) != side(b) && near(a) && near(b)
}

/// A cut: a plane by its normal and offset, in a ball by its middle and radius.
pub fn cuts() -> impl Strategy<Value = Cut> {
    let middle = prop::array::uniform3(0..32i32);
    (prop::array::uniform3(-2..=2i32), middle, 4..24i32).prop_map(|(n, middle, radius)| {
        let d = (0..3).map(|i| n[i] * middle[i]).sum();
        (n, d, (middle, radius))
    })
}
