//! The finest tetrahedra inside a leaf, and the faces between them.

use crate::bisection::delta::Tet;
use crate::bisection::forest::BisectionForest;
use crate::bisection::geometry::FACES;
use crate::bisection::kuhn::{Point, bisect, midpoint};
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
        let units = self.finest_units();
        let corners = leaf.vertices.map(|v| self.point(v).map(|c| c * units));
        let torn = self.cuts.torn(self.leaf_of(leaf.id).0);
        let whole = torn.map_or(leaf.node, |torn| torn.whole);
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
