//! The finest tetrahedra inside a leaf, and the faces between them.

use crate::bisection::delta::Tet;
use crate::bisection::forest::BisectionForest;
use crate::bisection::geometry::FACES;
use crate::bisection::kuhn::{Point, bisect, bisected_corner, midpoint};
use crate::bisection::label_tree::NodeRef;
use crate::bisection::lattice::Lattice;

/// A face of a finest tetrahedron, known by the sum of its corners on the lattice of the finest level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FineFace(Point);

/// A finest tetrahedron: that of a voxel's size, or of the forest's finest level if that is smaller.
#[derive(Clone, Copy, Debug)]
pub struct FineTet {
    /// Its corners, on the lattice of the [finest level](BisectionForest::finest_level).
    pub corners: [Point; 4],
    /// Its faces; face i is opposite corner i.
    pub faces: [FineFace; 4],
    /// Its dense label.
    pub label: u16,
}

impl FineTet {
    /// Whether it holds anything but void.
    pub fn is_solid(&self) -> bool {
        self.label != 0
    }
}

/// The finest tetrahedron in which a point lies, by the order of [`finest_in`](BisectionForest::finest_in), of a leaf of
/// `level` where the point has the barycentric coordinates `weights`; for one outside of it the nearest in this sense.
pub fn finest_at(mut weights: [f64; 4], level: u8, finest_level: u8) -> usize {
    let mut number = 0;
    for level in level..finest_level {
        let (a, b) = (weights[0], weights[bisected_corner(level)]);
        let half = usize::from(a < b);
        (weights[0], weights[bisected_corner(level)]) = (a - b, b - a);
        weights = bisect(&weights, level, 2.0 * a.min(b))[half];
        number = 2 * number + half;
    }
    number
}

fn sum(points: [Point; 3]) -> Point {
    std::array::from_fn(|axis| points.iter().map(|p| p[axis]).sum())
}

impl BisectionForest {
    /// The level of the finest tetrahedra, between which cuts go: that of voxels, or of the finest leaves if these are
    /// smaller.
    pub fn finest_level(&self) -> u8 {
        self.max_level.max(self.tree.grid().embed_level())
    }

    /// Lattice units of the finest level in a lattice unit of the forest.
    pub fn finest_units(&self) -> i32 {
        let lattice = self.domain.lattice();
        Lattice::new(lattice.cells, self.finest_level()).units / lattice.units
    }

    /// The finest tetrahedra in a leaf, given as any of its sheets, in all of them together, in the order of bisection.
    ///
    /// Cost: O(finest tetrahedra) = 2^(finest level − its level).
    pub fn finest_in(&self, leaf: &Tet) -> Vec<FineTet> {
        let torn = self.cuts.torn(self.leaf_of(leaf.id).0);
        self.finest_of(leaf, torn.map_or(leaf.node, |torn| torn.whole))
    }

    /// The same of a leaf whose content as a whole is `whole`.
    pub(super) fn finest_of(&self, leaf: &Tet, whole: NodeRef) -> Vec<FineTet> {
        let units = self.finest_units();
        let corners = leaf.vertices.map(|v| self.point(v).map(|c| c * units));
        let mut found = Vec::with_capacity(1 << (self.finest_level() - leaf.level));
        self.descend(&corners, leaf.level, whole, &mut found);
        found
    }

    fn descend(&self, corners: &[Point; 4], level: u8, node: NodeRef, found: &mut Vec<FineTet>) {
        if level == self.finest_level() {
            let faces = FACES.map(|face| FineFace(sum(face.map(|i| corners[i]))));
            found.push(FineTet { corners: *corners, faces, label: self.tree.majority(node) });
            return;
        }
        let halves = bisect(corners, level, midpoint(corners, level));
        for (half, node) in halves.iter().zip(self.tree.children(node)) {
            self.descend(half, level + 1, node, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bisection::kuhn::root_corners;

    /// The middle of each finest tetrahedron is found in it, by weights in the whole.
    #[test]
    fn middles_lie_where_they_are_found() {
        for (order, level) in [(0, 0u8), (3, 0), (5, 0), (1, 0)] {
            let root = root_corners([1, 0, 2], order, 4);
            let mut fine = vec![(
                root,
                [
                    [1.0, 0.0, 0.0, 0.0],
                    [0.0, 1.0, 0.0, 0.0],
                    [0.0, 0.0, 1.0, 0.0],
                    [0.0, 0.0, 0.0, 1.0],
                ],
            )];
            for level in level..5 {
                fine = fine
                    .into_iter()
                    .flat_map(|(corners, weights): ([Point; 4], [[f64; 4]; 4])| {
                        let [a, b] = [weights[0], weights[bisected_corner(level)]];
                        let z = std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
                        let [c, d] = bisect(&corners, level, midpoint(&corners, level));
                        let [u, v] = bisect(&weights, level, z);
                        [(c, u), (d, v)]
                    })
                    .collect();
            }
            for (i, (_, weights)) in fine.iter().enumerate() {
                let middle = std::array::from_fn(|k| weights.iter().map(|w| 0.25 * w[k]).sum());
                assert_eq!(finest_at(middle, 0, 5), i);
            }
        }
    }
}
