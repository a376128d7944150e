//! A body whose voxels change is the body that is made of the changed voxels.

use std::sync::Arc;

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_embed::{Embedding, Material, Materials, VoidRule, by_name};
use yawara_mesh::{BisectionForest, LabelTree, MeshDelta};
use yawara_tests::organ::{Organ, organs};

const LEVELS: u8 = 7;

fn materials(organ: &Organ, void: VoidRule) -> Materials {
    let solid = organ.materials.iter().map(|&(e, nu)| Material::new(e, nu, 1000.0).unwrap());
    let all: Vec<Material> =
        [Material::new(1.0, 0.0, 0.0).unwrap()].into_iter().chain(solid).collect();
    Materials::from(all).with_void(void)
}

fn embed(organ: &Organ, void: VoidRule) -> Embedding {
    let go_on = &mut |_| std::ops::ControlFlow::Continue(());
    let rule = by_name("laminate").unwrap();
    Embedding::with_materials(organ.tree(), materials(organ, void), rule, go_on).unwrap()
}

/// The leaves, and what each is made of: labels, majority, elasticity, density.
fn check_same(forest: &BisectionForest, edited: &Embedding, organ: &Organ, void: VoidRule) {
    let mut anew = organ.forest(0, LEVELS);
    let mut delta = MeshDelta::empty();
    let points = forest.vertices().map(|v| forest.point(v));
    let mut missing: Vec<_> = points.filter(|&p| anew.vertex_at(p).is_none()).collect();
    while !missing.is_empty() {
        missing.retain(|&p| !anew.is_ready(p) || anew.split(p, &mut delta).is_err());
    }
    let fresh = embed(organ, void);
    let go_on = &mut |_| std::ops::ControlFlow::Continue(());
    let others = edited.of_others(edited.materials(), go_on).unwrap();
    let by_corners = |forest: &BisectionForest| {
        let corners = |tet: &yawara_mesh::Tet| tet.vertices.map(|v| forest.point(v));
        let mut leaves: Vec<_> = forest.leaves().map(|tet| (corners(&tet), tet.node)).collect();
        leaves.sort_unstable_by_key(|leaf| leaf.0);
        leaves
    };
    let (found, want) = (by_corners(forest), by_corners(&anew));
    assert_eq!(found.len(), want.len());
    for ((corners, node), (other, expected)) in found.into_iter().zip(want) {
        assert_eq!(corners, other);
        let trees = [edited.tree(), fresh.tree()];
        assert_eq!(trees[0].labels(node).as_slice(), trees[1].labels(expected).as_slice());
        assert_eq!(trees[0].majority(node), trees[1].majority(expected));
        assert_eq!(edited.elasticity(node), fresh.elasticity(expected));
        assert_eq!(others.of(node), edited.elasticity(node));
        assert_eq!(edited.density(node), fresh.density(expected));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    #[test]
    fn an_edited_body_is_one_made_of_the_edited_voxels(
        organ in organs([2, 1, 2], 3, 2.0..5.0, -0.5..0.49),
        rounds in proptest::collection::vec(
            (proptest::collection::vec((any::<Index>(), 0..=3u16), 0..40), any::<Index>(), any::<bool>()),
            1..12,
        ),
        scales in any::<bool>(),
    ) {
        let void = if scales { VoidRule::Volume } else { VoidRule::Material };
        let mut organ = organ;
        let mut volume = organ.volume();
        let mut forest = organ.forest(0, LEVELS);
        let mut embedding = embed(&organ, void);
        let mut delta = MeshDelta::empty();
        let grid = *embedding.tree().grid();
        for (edits, pick, splits) in rounds {
            let mut cells = Vec::new();
            for (at, label) in edits {
                let at = at.index(organ.labels.len());
                volume.set(at, label).unwrap();
                organ.labels[at] = label;
                let [nx, ny, _] = volume.grid().dims;
                let voxel = [at % nx, at / nx % ny, at / (nx * ny)];
                cells.push(grid.cell_of(voxel.map(|v| v as i64)));
            }
            cells.sort_unstable();
            cells.dedup();
            let tree = embedding.tree().edited(&volume, &cells, &|_| false).unwrap();
            let tree = Arc::new(tree);
            embedding.relabel(Arc::clone(&tree), &cells).unwrap();
            let leaves = forest.relabel(tree, &cells);
            let of_cells = forest.leaves().filter(|leaf| leaves.iter().any(|one| one.id == leaf.id));
            prop_assert_eq!(of_cells.count(), leaves.len());
            check_same(&forest, &embedding, &organ, void);
            // What comes and goes afterwards takes from the edited tree.
            if splits {
                let candidates = forest.candidates();
                forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
            } else {
                let goes = forest.vertices().find(|&v| forest.is_mergeable(v));
                if let Some(v) = goes {
                    forest.merge(v, &mut delta).unwrap();
                }
            }
            check_same(&forest, &embedding, &organ, void);
        }
    }
}

#[test]
fn ten_thousand_edits_leave_a_bounded_tree() {
    let organ = Organ::homogeneous([2, 1, 1], 1e3, 0.3);
    let mut volume = organ.volume();
    let mut tree: LabelTree = (*organ.tree()).clone();
    let voxels = volume.labels().len();
    let mut state = 1_u64;
    let mut most_live = 0;
    for _ in 0..10_000 {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let at = (state >> 33) as usize % voxels;
        volume.set(at, (state >> 20) as u16 % 2).unwrap();
        let cell = usize::from(at % 8 >= 4);
        tree = tree.edited(&volume, &[cell], &|_| false).unwrap();
        most_live = most_live.max(tree.cell_nodes(0).len() + tree.cell_nodes(1).len());
    }
    assert!(tree.node_count() <= 5 * most_live, "{} nodes for {most_live}", tree.node_count());
}
