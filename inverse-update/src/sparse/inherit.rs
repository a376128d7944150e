//! The elimination order of a matrix that some updates made of one with a known order.

use std::cmp::Reverse;

use super::factor::NONE;
use super::pattern::Pattern;

/// Where a vertex is in the order: with an old vertex of this rank, the later placed the earlier.
type Place = (u32, Reverse<u32>);

/// The vertices in the order of their elimination: those with a rank by it, every other one right before a neighbour.
///
/// That is the one whose own neighbours are most of the new vertex's: for the middle of an edge one of its ends, the earlier
/// of both. Whatever separators have kept apart stays apart then. Cost: O(n log n), and the square of its neighbours for
/// each new vertex.
pub(super) fn inherited_order(pattern: &Pattern, ranks: &[u32]) -> Vec<usize> {
    let known = |&rank: &u32| (rank != NONE).then_some((rank, Reverse(0)));
    let mut places: Vec<Option<Place>> = ranks.iter().map(known).collect();
    let mut later = 0;
    for v in 0..pattern.vertices() {
        if places[v].is_some() {
            continue;
        }
        let around = pattern.neighbours(v);
        let shared = |w: usize| {
            let other = pattern.neighbours(w);
            around.iter().filter(|x| other.binary_search(x).is_ok()).count()
        };
        let placed = around.iter().filter_map(|&w| Some((w as usize, places[w as usize]?)));
        let beside = placed.max_by_key(|&(w, place)| (shared(w), Reverse(place)));
        later += 1;
        places[v] = Some((beside.map_or(0, |(_, (rank, _))| rank), Reverse(later)));
    }
    let mut order: Vec<usize> = (0..pattern.vertices()).collect();
    order.sort_by_key(|&v| places[v]);
    order
}

#[cfg(test)]
mod tests {
    use super::super::dissection;
    use super::super::symbolic::Symbolic;
    use super::*;
    use crate::SparseStiffness;
    use faer::Mat;

    /// A box of vertices tied to those one step away along the axes and diagonals, halved `refined` times: the middle of a
    /// tie is tied to its ends and to what both of these are tied to.
    fn refined(side: i64, refined: usize) -> (SparseStiffness, usize) {
        let mut points: Vec<[i64; 3]> = (0..side.pow(3))
            .map(|at| [at % side, at / side % side, at / side / side].map(|x| 64 * x))
            .collect();
        let old = points.len();
        let near = |p: [i64; 3], q: [i64; 3]| {
            let steps: Vec<i64> = (0..3).map(|i| (q[i] - p[i]) / 64).collect();
            p != q
                && (steps.iter().all(|s| [0, 1].contains(s))
                    || steps.iter().all(|s| [0, -1].contains(s)))
        };
        let mut ties: Vec<Vec<usize>> =
            points.iter().map(|&p| (0..old).filter(|&w| near(p, points[w])).collect()).collect();
        for step in 0..refined {
            // In one corner, as under a tool.
            let a = step * 7 % 40;
            let Some(&b) = ties[a].iter().max() else { continue };
            let ring: Vec<usize> =
                ties[a].iter().copied().filter(|w| ties[b].contains(w)).chain([a, b]).collect();
            let middle = points.len();
            points.push(std::array::from_fn(|i| (points[a][i] + points[b][i]) / 2));
            ties[a].retain(|&w| w != b);
            ties[b].retain(|&w| w != a);
            ring.iter().for_each(|&w| ties[w].push(middle));
            ties.push(ring);
        }
        let mut k = SparseStiffness::zeros(points.len(), 1).unwrap();
        let keys = points.iter().map(|p| (p[0] | p[1] << 21 | p[2] << 42) as u64);
        k.set_order_keys(&keys.collect::<Vec<_>>()).unwrap();
        let tie = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { -1.0 });
        for (v, others) in ties.iter().enumerate() {
            k.add(&[v], Mat::from_fn(1, 1, |_, _| 1.0).as_ref()).unwrap();
            for &w in others.iter().filter(|&&w| w > v) {
                k.add(&[v, w], tie.as_ref()).unwrap();
            }
        }
        (k, old)
    }

    #[test]
    fn an_inherited_order_costs_about_as_much_as_a_new_one() {
        let (before, old) = refined(7, 0);
        let pattern = Pattern::of(&before);
        let mut ranks = vec![NONE; old];
        let symbolic = Symbolic::new(&pattern, dissection::order(&pattern));
        (0..).zip(&symbolic.order).for_each(|(rank, &slot)| ranks[slot] = rank);
        for count in [10, 60] {
            let (after, _) = refined(7, count);
            let pattern = Pattern::of(&after);
            ranks.resize(pattern.vertices(), NONE);
            let operations = |order| Symbolic::new(&pattern, order).operations(1);
            let order = inherited_order(&pattern, &ranks);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..pattern.vertices()));
            let kept: Vec<usize> = order.iter().copied().filter(|&v| v < old).collect();
            assert_eq!(kept, symbolic.order);
            let (inherited, new) = (operations(order), operations(dissection::order(&pattern)));
            // As walks leave it: the newest first.
            let first = (old..pattern.vertices()).rev().chain(symbolic.order.iter().copied());
            let naive = operations(first.collect());
            assert!(inherited < 1.15 * new, "{count}: {inherited} for {new}");
            assert!(inherited < naive, "{count}: {inherited}, newest first {naive}");
        }
    }

    #[test]
    fn vertices_without_any_neighbour_and_without_ranks_have_a_place_too() {
        let pattern = Pattern::of(&refined(3, 0).0);
        let mut order = inherited_order(&pattern, &vec![NONE; pattern.vertices()]);
        order.sort_unstable();
        assert!(order.into_iter().eq(0..27));
        let alone = SparseStiffness::zeros(2, 3).unwrap();
        assert_eq!(inherited_order(&Pattern::of(&alone), &[0, NONE]), [1, 0]);
    }
}
