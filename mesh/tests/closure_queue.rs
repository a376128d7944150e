//! Split requests served in slices: the same mesh as at once, best first, whatever else happens.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::sync::Arc;

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::{BisectionForest, ClosureQueue, Domain, LabelTree, Lattice, MeshDelta, Point};

const MAX_LEVEL: u8 = 12;

fn forest(cut_out: &[usize]) -> BisectionForest {
    let cells = [2, 2, 2];
    let mut domain = Domain::full(Lattice::new(cells, MAX_LEVEL));
    domain.exclude(cut_out);
    BisectionForest::new(domain, Arc::new(LabelTree::homogeneous(cells, 1)), 0, MAX_LEVEL).unwrap()
}

fn active(f: &BisectionForest) -> BTreeSet<Point> {
    f.vertices().map(|v| f.point(v)).collect()
}

/// Any lattice point of the box: vertices, possible vertices, and points of cells cut out.
fn point() -> impl Strategy<Value = Point> {
    // Spacings from 16 to 1, so that coarse points are not rare.
    (0..5u32, 0..33i32, 0..33i32, 0..33i32)
        .prop_map(|(shift, x, y, z)| [x, y, z].map(|c| c >> shift << shift))
}

/// 6, 20, then 28k − 42 vertices for a request at generation 3k.
fn bound(generation: u8) -> usize {
    match usize::from(generation.div_ceil(3)) {
        0 => 0,
        1 => 6,
        2 => 20,
        k => 28 * k - 42,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn slices_of_any_size_give_the_mesh_of_whole_closures(
        requests in proptest::collection::vec((point(), -4..4i32), 1..40),
        slices in proptest::collection::vec(0..9usize, 1..20),
        cut in any::<bool>(),
    ) {
        let cut_out: &[usize] = if cut { &[1, 6] } else { &[] };
        let mut delta = MeshDelta::empty();
        let mut at_once = forest(cut_out);
        let mut sliced = at_once.clone();
        let mut queue = ClosureQueue::new();
        for &(p, priority) in &requests {
            // Refused where there is nothing to split, as the queue drops it.
            let _ = at_once.split_with_closure(p, &mut delta, |_, _| ());
            queue.push(p, f64::from(priority)).unwrap();
        }
        let mut came_in = Vec::new();
        for &budget in slices.iter().cycle() {
            let visited = came_in.len();
            let done = queue
                .drain(&mut sliced, budget, || false, &mut delta, |f, d| {
                    came_in.push(f.point(d.vertex));
                })
                .unwrap();
            prop_assert_eq!(came_in.len() - visited, done);
            if queue.is_empty() || slices.iter().all(|&s| s == 0) {
                break;
            }
        }
        queue.drain(&mut sliced, usize::MAX, || false, &mut delta, |_, _| ()).unwrap();
        prop_assert_eq!(active(&sliced), active(&at_once));
        prop_assert!(queue.is_empty());
    }

    /// Against the closure derived anew before every step, with splits, merges and requests of
    /// others in between.
    #[test]
    fn each_vertex_is_the_oldest_that_the_best_request_lacks(
        steps in proptest::collection::vec((0..8u8, any::<Index>(), point(), -3..3i32), 150),
        cut in any::<bool>(),
    ) {
        let mut f = forest(if cut { &[1, 6] } else { &[] });
        let mut delta = MeshDelta::empty();
        let mut queue = ClosureQueue::new();
        let mut wanted: Vec<(Point, i32)> = Vec::new();
        for (kind, index, p, priority) in steps {
            match kind {
                0 | 1 => {
                    queue.push(p, priority.into()).unwrap();
                    match wanted.iter_mut().find(|w| w.0 == p) {
                        Some(known) => known.1 = known.1.max(priority),
                        None => wanted.push((p, priority)),
                    }
                }
                2 => {
                    let all = f.candidates();
                    f.split(all[index.index(all.len())], &mut delta).unwrap();
                }
                3 => {
                    let all: Vec<_> = f.vertices().filter(|&v| f.is_mergeable(v)).collect();
                    if !all.is_empty() {
                        f.merge(all[index.index(all.len())], &mut delta).unwrap();
                    }
                }
                4 if !wanted.is_empty() => {
                    let gone = wanted.remove(index.index(wanted.len())).0;
                    queue.remove(gone);
                }
                _ => {
                    // What is done or impossible goes when its turn comes.
                    let best = loop {
                        let best = wanted.iter().enumerate().max_by_key(|(_, (p, priority))| {
                            (*priority, Reverse(Lattice::key(*p)))
                        });
                        let Some((at, &(p, _))) = best else { break None };
                        if possible(&f, p) && f.vertex_at(p).is_none() {
                            break Some(p);
                        }
                        wanted.remove(at);
                    };
                    let expected = best.map(|p| f.closure(p)[0]);
                    prop_assert_eq!(queue.next(&f), expected);
                    // Asked twice, and one vertex drained: nothing else happens.
                    prop_assert_eq!(queue.next(&f), expected);
                    prop_assert_eq!(queue.len(), wanted.len());
                    let mut came_in = None;
                    queue.drain(&mut f, 1, || false, &mut delta, |f, d| {
                        came_in = Some(f.point(d.vertex));
                    }).unwrap();
                    prop_assert_eq!(came_in, expected);
                }
            }
        }
    }

    #[test]
    fn one_request_brings_no_more_than_the_bound(
        picks in proptest::collection::vec(any::<Index>(), 120),
    ) {
        let mut f = forest(&[]);
        let mut delta = MeshDelta::empty();
        let mut queue = ClosureQueue::new();
        for pick in picks {
            let mut leaves: Vec<_> = f.leaves().filter(|t| t.level < MAX_LEVEL).collect();
            leaves.sort_by_key(|t| Reverse(t.level));
            leaves.truncate(leaves.len().div_ceil(10));
            let p = f.refinement_point(leaves[pick.index(leaves.len())].id).unwrap();
            queue.push(p, 1.0).unwrap();
            let limit = bound(f.domain().lattice().generation(p));
            let came_in = queue.drain(&mut f, limit, || false, &mut delta, |_, _| ()).unwrap();
            prop_assert!((1..=limit).contains(&came_in));
            prop_assert_eq!(queue.next(&f), None, "more than {}", limit);
        }
    }
}

/// Whether a vertex at `p` belongs to the finest mesh there is on this domain.
fn possible(f: &BisectionForest, p: Point) -> bool {
    let lattice = f.domain().lattice();
    lattice.contains(p) && lattice.generation(p) <= f.max_level() && f.domain().contains(p)
}

#[test]
fn the_clock_is_asked_before_every_vertex() {
    let mut f = forest(&[]);
    let mut delta = MeshDelta::empty();
    let mut queue = ClosureQueue::with_capacity(4);
    queue.push([1, 2, 3], 0.0).unwrap();
    let whole = f.closure([1, 2, 3]);
    assert!(whole.len() > 10);
    let mut asked = 0;
    let clock = || {
        asked += 1;
        asked > 7
    };
    let mut came_in = Vec::new();
    let visit = |f: &BisectionForest, d: &MeshDelta| came_in.push(f.point(d.vertex));
    assert_eq!(queue.drain(&mut f, 100, clock, &mut delta, visit).unwrap(), 7);
    assert_eq!((asked, &came_in[..]), (8, &whole[..7]));
    assert_eq!(queue.drain(&mut f, 100, || true, &mut delta, |_, _| ()).unwrap(), 0);
    assert_eq!(queue.drain(&mut f, 0, || false, &mut delta, |_, _| ()).unwrap(), 0);
    assert_eq!(f.closure([1, 2, 3]), whole[7..]);
}

#[test]
fn what_can_never_be_split_is_dropped() {
    let mut f = forest(&[1]);
    let mut queue = ClosureQueue::new();
    // A root vertex, a point of a cell that is out, and points off the lattice.
    let extremes = [[-1, 0, 0], [33, 0, 0], [i32::MAX; 3], [i32::MIN; 3]];
    for p in [[0, 0, 0], [24, 8, 8]].into_iter().chain(extremes) {
        queue.push(p, 1.0).unwrap();
    }
    queue.push([8, 8, 8], 0.0).unwrap();
    assert_eq!((queue.len(), queue.next(&f), queue.len()), (7, Some([8, 8, 8]), 1));
    f.split([8, 8, 8], &mut MeshDelta::empty()).unwrap();
    assert_eq!((queue.next(&f), queue.len()), (None, 0));
    assert!(f.closure([i32::MAX; 3]).is_empty());
}
