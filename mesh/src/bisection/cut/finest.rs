//! The finest tetrahedra inside a leaf.

use super::fine::FineTet;
use crate::bisection::delta::Tet;
use crate::bisection::forest::BisectionForest;
use crate::bisection::kuhn::{Point, bisect, midpoint};
use crate::bisection::label_tree::NodeRef;
use crate::bisection::lattice::Lattice;

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
            found.push(FineTet::new(corners, self.tree.majority(node)));
            return;
        }
        let halves = bisect(corners, level, midpoint(corners, level));
        for (half, node) in halves.iter().zip(self.tree.children(node)) {
            self.descend(half, level + 1, node, found);
        }
    }
}
