//! Sorts a new forest so that neighbours in space are neighbours in memory.

use super::diamond::{NONE, tet_number, tet_place};
use super::forest::BisectionForest;
use super::point_map::z_order;

impl BisectionForest {
    /// Numbers the diamonds of a fresh forest in the Z-order of their points; vertices keep
    /// their numbers. A split then finds its older vertices on the same pages of memory as
    /// the ring. Cost: O(n log n).
    pub(crate) fn sort_diamonds(&mut self) {
        let mut order: Vec<u32> = (0..self.diamonds.len() as u32).collect();
        order.sort_by_cached_key(|&id| z_order(self.diamonds[id as usize].point));
        let mut number = vec![0; order.len()];
        for (new, &old) in order.iter().enumerate() {
            number[old as usize] = new as u32;
        }
        for id in 0..self.diamonds.len() {
            self.renumber_inside(id, &number);
        }
        for vertex in &mut self.vertices {
            vertex.diamond = number[vertex.diamond as usize];
        }
        for at in 0..number.len() {
            while number[at] as usize != at {
                let to = number[at] as usize;
                self.diamonds.swap(at, to);
                number.swap(at, to);
            }
        }
        self.open.clear();
        for id in 0..self.diamonds.len() {
            if self.diamonds[id].open_at != NONE {
                self.open_diamond(id as u32);
            }
        }
    }

    /// Follows a renumbering in what one diamond holds and in the map of points.
    fn renumber_inside(&mut self, id: usize, number: &[u32]) {
        let diamond = &mut self.diamonds[id];
        for older in diamond.dependencies.iter_mut().filter(|d| **d != NONE) {
            *older = number[*older as usize];
        }
        for tet in &mut diamond.tets {
            for child in tet.children.iter_mut().filter(|c| **c != NONE) {
                let (home, slot) = tet_place(*child);
                *child = tet_number(number[home], slot);
            }
        }
        if diamond.level < self.max_level || diamond.members == 0 {
            self.by_point.set_at(diamond.place, number[id]);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::bisection::diamond::occupied;
    use crate::{Domain, LabelTree, Lattice};

    /// The halves of a start mesh's tetrahedra are found by their numbers, and hold the vertex.
    #[test]
    fn numbers_of_halves_follow() {
        let cells = [2, 1, 2];
        let domain = Domain::full(Lattice::new(cells, 5));
        let tree = Arc::new(LabelTree::homogeneous(cells, 1));
        let forest = BisectionForest::new(domain, tree, 4, 5).unwrap();
        let keys: Vec<u64> = forest.diamonds.iter().map(|d| z_order(d.point)).collect();
        assert!(keys.is_sorted());
        let mut halves = 0;
        for diamond in forest.diamonds.iter().filter(|d| d.vertex != NONE) {
            for slot in occupied(diamond.members) {
                for child in diamond.tets[slot].children {
                    let (home, at) = tet_place(child);
                    let half = &forest.diamonds[home].tets[at];
                    assert!(forest.diamonds[home].members & (1 << at) != 0);
                    assert_eq!(half.level, diamond.level + 1);
                    assert!(half.vertices.iter().any(|v| v.0 == diamond.vertex));
                    halves += 1;
                }
            }
        }
        assert_eq!(halves, 4 * 6 * (2 + 4 + 8 + 16));
    }
}
