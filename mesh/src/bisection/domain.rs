//! Which root cubes belong to the body.

use super::kuhn::{Point, root_faces};
use super::label_tree::LabelTree;
use super::lattice::Lattice;
use crate::union_find::groups;

/// A set of root cubes, fixed for the life of a forest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    lattice: Lattice,
    inside: Vec<bool>,
}

impl Domain {
    /// All cubes of a box.
    pub fn full(lattice: Lattice) -> Self {
        Self { inside: vec![true; lattice.cell_count()], lattice }
    }

    /// The cubes that hold anything but background.
    pub fn of_labels(lattice: Lattice, tree: &LabelTree) -> Self {
        let inside = (0..lattice.cell_count()).map(|cell| tree.cell_is_solid(cell)).collect();
        Self { lattice, inside }
    }

    /// The lattice it lies on.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The cubes inside, ascending linear numbers.
    pub fn cells(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.inside.len()).filter(|&cell| self.inside[cell])
    }

    /// True where a cube (its linear number) is inside.
    pub fn has_cell(&self, cell: usize) -> bool {
        self.inside.get(cell).copied().unwrap_or(false)
    }

    /// True where `p` lies in the closure of the body.
    pub fn contains(&self, p: Point) -> bool {
        self.lattice.cells_around(p).any(|cell| self.inside[cell])
    }

    /// Face-connected groups of cubes, each ascending, in the order of their first cube. Cubes
    /// joined only by an edge or a vertex are different groups: such a joint is a mechanism.
    pub fn components(&self) -> Vec<Vec<usize>> {
        let pairs = self.cells().flat_map(|cell| {
            let at = self.lattice.cell_coordinates(cell);
            let above = (0..3).filter_map(move |axis| self.beside(at, axis, true));
            above.filter(|&next| self.inside[next]).map(move |next| [cell as u32, next as u32])
        });
        let mut groups = groups(self.inside.len(), pairs);
        groups.retain(|group| self.inside[group[0]]);
        groups
    }

    /// The next cube along an axis, up or down.
    fn beside(&self, mut at: [usize; 3], axis: usize, up: bool) -> Option<usize> {
        at[axis] = if up { at[axis] + 1 } else { at[axis].checked_sub(1)? };
        (at[axis] < self.lattice.cells[axis]).then(|| self.lattice.cell_number(at))
    }

    /// Which faces of root tetrahedron `order` of a cube have no cube of the body behind them
    /// (bit i: the face opposite corner i).
    pub fn root_hull(&self, cell: usize, order: usize) -> u8 {
        let c = self.lattice.cell_coordinates(cell);
        root_faces(order).into_iter().fold(0, |hull, (axis, with_walk, opposite)| {
            // The walk goes up from even cubes and down from odd ones.
            let up = with_walk == c[axis].is_multiple_of(2);
            let covered = self.beside(c, axis, up).is_some_and(|n| self.inside[n]);
            hull | u8::from(!covered) << opposite
        })
    }

    /// Takes cubes out of the body.
    pub fn exclude(&mut self, cells: &[usize]) {
        for &cell in cells {
            self.inside[cell] = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubes_that_touch_in_an_edge_are_two_components() {
        let mut domain = Domain::full(Lattice::new([2, 2, 1], 3));
        domain.exclude(&[1, 2]);
        assert_eq!(domain.components(), vec![vec![0], vec![3]]);
        assert!(domain.contains([2, 2, 1]), "the shared edge belongs to both");
        assert!(!domain.contains([4, 0, 0]));
    }
}
