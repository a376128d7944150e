//! Other labels under a mesh that stays as it is.

use std::sync::Arc;

use super::delta::Tet;
use super::diamond::{NONE, tet_number, tet_place};
use super::forest::BisectionForest;
use super::kuhn::{ROOTS_PER_CELL, midpoint, root_corners};
use super::label_tree::{LabelTree, NodeRef};

impl BisectionForest {
    /// Gives the mesh the labels of another tree on the same grid, such as an [edited](LabelTree::edited) one, whose
    /// content differs in `cells` alone. Returns the leaves in these, by cell; the domain, and so the mesh, stays, even
    /// where nothing but void is left.
    ///
    /// Cost: O(tetrahedra of all levels in these cells).
    ///
    /// # Panics
    /// If the trees' grids differ; if a leaf in the cells is cut.
    pub fn relabel(&mut self, tree: Arc<LabelTree>, cells: &[usize]) -> Vec<Tet> {
        assert_eq!(tree.grid(), self.tree.grid(), "a tree on another grid");
        self.tree = tree;
        let lattice = *self.domain.lattice();
        let (mut leaves, mut below) = (Vec::new(), Vec::new());
        for &cell in cells {
            if !self.domain.has_cell(cell) {
                continue;
            }
            for order in (0..ROOTS_PER_CELL).rev() {
                let corners = root_corners(lattice.cell_coordinates(cell), order, lattice.units);
                let home = self.by_point.get(midpoint(&corners, 0));
                let slot = self.shapes.get(self.shapes.of_root(&corners)).slot;
                below.push((tet_number(home, usize::from(slot)), self.tree.root(cell, order)));
            }
            self.hand_down(&mut below, &mut leaves);
        }
        leaves
    }

    /// Gives tetrahedra, and all below them, their content; empties `below` and adds the leaves among them.
    fn hand_down(&mut self, below: &mut Vec<(u32, NodeRef)>, leaves: &mut Vec<Tet>) {
        while let Some((number, node)) = below.pop() {
            let (diamond, slot) = tet_place(number);
            let is_split = self.diamonds[diamond].vertex != NONE;
            let record = &mut self.diamonds[diamond].tets[slot];
            record.node = node;
            if is_split {
                let halves = record.children.into_iter().zip(self.tree.children(node));
                below.extend(halves.rev());
            } else {
                assert!(self.cuts.torn(number).is_none(), "another content of what is cut");
                leaves.push(record.tet(number));
            }
        }
    }
}
