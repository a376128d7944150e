//! How many vertices a split request brings along: never more than the bound, few on average.

use std::sync::Arc;

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::{BisectionForest, Domain, LabelTree, Lattice, MeshDelta};

fn forest(cells: usize, max_level: u8) -> BisectionForest {
    let cells = [cells; 3];
    let domain = Domain::full(Lattice::new(cells, max_level));
    BisectionForest::new(domain, Arc::new(LabelTree::homogeneous(cells, 1)), 0, max_level).unwrap()
}

/// Most vertices that one request at this generation adds, itself included: 6, 20, then 28k − 42
/// at generation 3k (all older vertices missing; found by exhaustion in an independent
/// prototype).
fn bound(generation: u8) -> usize {
    match usize::from(generation.div_ceil(3)) {
        0 => 0,
        1 => 6,
        2 => 20,
        k => 28 * k - 42,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    #[test]
    fn a_request_never_adds_more_than_the_bound(
        picks in proptest::collection::vec(any::<Index>(), 400),
        deep in any::<bool>(),
    ) {
        let mut f = forest(2, 15);
        let mut delta = MeshDelta::empty();
        for pick in &picks {
            // Uniformly among leaves, or among the deepest tenth: grading at its steepest.
            let mut leaves: Vec<_> = f.leaves().filter(|t| t.level < 15).collect();
            if deep {
                leaves.sort_by_key(|t| std::cmp::Reverse(t.level));
                leaves.truncate(leaves.len().div_ceil(10));
            }
            let p = f.refinement_point(leaves[pick.index(leaves.len())].id).unwrap();
            let generation = f.domain().lattice().generation(p);
            let before = f.vertex_count();
            f.split_with_closure(p, &mut delta, |_, _| ()).unwrap();
            let new = f.vertex_count() - before;
            prop_assert!((1..=bound(generation)).contains(&new), "{} at {}", new, generation);
        }
    }
}

#[test]
fn random_refinement_adds_about_three_vertices_a_request() {
    // A fixed, well mixed sequence: one million requests would say the same.
    let mut f = forest(2, 18);
    let mut delta = MeshDelta::empty();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let (mut requests, mut added) = (0usize, 0usize);
    while f.vertex_count() < 4_000 {
        let leaves: Vec<_> = f.leaves().filter(|t| t.level < 18).collect();
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let p = f.refinement_point(leaves[(state >> 33) as usize % leaves.len()].id).unwrap();
        let before = f.vertex_count();
        f.split_with_closure(p, &mut delta, |_, _| ()).unwrap();
        requests += 1;
        added += f.vertex_count() - before;
    }
    let mean = added as f64 / requests as f64;
    println!("{mean:.2} vertices per request over {requests} requests");
    assert!((2.4..3.4).contains(&mean), "{mean}");
}
