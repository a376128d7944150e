//! The closed form of a vertex's edge against the rings that a forest splits.

use std::sync::Arc;

use proptest::prelude::*;
use yawara_mesh::{BisectionForest, Domain, LabelTree, Lattice, MeshDelta};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn every_split_bisects_the_edge_of_its_point(choices in prop::collection::vec(any::<usize>(), 200)) {
        let cells = [3, 2, 2];
        let lattice = Lattice::new(cells, 12);
        let tree = Arc::new(LabelTree::homogeneous(cells, 1));
        let mut forest = BisectionForest::new(Domain::full(lattice), tree, 0, 12).unwrap();
        for v in forest.vertices() {
            prop_assert_eq!(lattice.edge_ends(forest.point(v)), None);
        }
        let mut delta = MeshDelta::empty();
        for choice in choices {
            let candidates = forest.candidates();
            let p = candidates[choice % candidates.len()];
            forest.split(p, &mut delta).unwrap();
            let mut ends = lattice.edge_ends(p).unwrap().map(|q| forest.vertex_at(q).unwrap());
            ends.sort_unstable();
            prop_assert_eq!(ends, delta.edge);
        }
    }
}
