//! Smallest vertex covers of bipartite graphs.

/// A smallest vertex cover of a bipartite graph, given by its edges (low, high); ascending on
/// either side.
///
/// By a largest matching with augmenting paths; cover and matching have the same size.
/// Cost: O(vertices · edges) at worst, near O(edges) on meshes.
/// # Source
/// Kőnig, Gráfok és mátrixok, 1931.
pub(crate) fn smallest_cover(edges: &[(usize, usize)]) -> Vec<usize> {
    let mut graph = Bipartite::new(edges);
    let lows = graph.low.len();
    for start in 0..lows {
        graph.round += 1;
        graph.augment(start);
    }
    // What alternating paths reach from unmatched low vertices: high ones of it, low ones of
    // the rest.
    graph.round += 1;
    let mut reached = vec![false; lows];
    let mut stack: Vec<usize> = (0..lows).filter(|&v| graph.mate_of_low[v] == NONE).collect();
    stack.iter().for_each(|&v| reached[v] = true);
    while let Some(v) = stack.pop() {
        for at in graph.starts[v]..graph.starts[v + 1] {
            let w = graph.ends[at];
            if graph.seen[w] == graph.round {
                continue;
            }
            graph.seen[w] = graph.round;
            let mate = graph.mate_of_high[w];
            if mate != NONE && !reached[mate] {
                reached[mate] = true;
                stack.push(mate);
            }
        }
    }
    let low = (0..lows).filter(|&v| !reached[v]).map(|v| graph.low[v]);
    let high = (0..graph.high.len()).filter(|&w| graph.seen[w] == graph.round);
    low.chain(high.map(|w| graph.high[w])).collect()
}

const NONE: usize = usize::MAX;

struct Bipartite {
    low: Vec<usize>,
    high: Vec<usize>,
    /// Low vertex v has the high neighbours `ends[starts[v]..starts[v + 1]]`.
    starts: Vec<usize>,
    ends: Vec<usize>,
    mate_of_low: Vec<usize>,
    mate_of_high: Vec<usize>,
    /// The last round that visited each high vertex.
    seen: Vec<usize>,
    round: usize,
}

impl Bipartite {
    fn new(edges: &[(usize, usize)]) -> Self {
        let mut edges = edges.to_vec();
        edges.sort_unstable();
        let mut low: Vec<usize> = edges.iter().map(|edge| edge.0).collect();
        low.dedup();
        let mut high: Vec<usize> = edges.iter().map(|edge| edge.1).collect();
        high.sort_unstable();
        high.dedup();
        let mut starts = Vec::with_capacity(low.len() + 1);
        let mut ends = Vec::with_capacity(edges.len());
        for &(v, w) in &edges {
            if starts.len() <= low.partition_point(|&other| other < v) {
                starts.push(ends.len());
            }
            ends.push(high.partition_point(|&other| other < w));
        }
        starts.push(ends.len());
        Self {
            mate_of_low: vec![NONE; low.len()],
            mate_of_high: vec![NONE; high.len()],
            seen: vec![0; high.len()],
            low,
            high,
            starts,
            ends,
            round: 0,
        }
    }

    /// Finds a path from an unmatched low vertex to an unmatched high one and swaps along it.
    fn augment(&mut self, start: usize) -> bool {
        // One entry per low vertex of the path: the vertex and its next edge to try.
        let mut path = vec![(start, self.starts[start])];
        while let Some(&(v, at)) = path.last() {
            if at == self.starts[v + 1] {
                path.pop();
                continue;
            }
            let deepest = path.len() - 1;
            path[deepest].1 += 1;
            let w = self.ends[at];
            if self.seen[w] == self.round {
                continue;
            }
            self.seen[w] = self.round;
            let mate = self.mate_of_high[w];
            if mate != NONE {
                path.push((mate, self.starts[mate]));
                continue;
            }
            for &(v, next) in &path {
                let w = self.ends[next - 1];
                self.mate_of_low[v] = w;
                self.mate_of_high[w] = v;
            }
            return true;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::random;

    #[test]
    fn stars_chains_and_grids_are_covered_by_hand() {
        assert_eq!(smallest_cover(&[]), [0; 0]);
        // A star: its centre.
        assert_eq!(smallest_cover(&[(7, 1), (7, 2), (7, 3)]), [7]);
        assert_eq!(smallest_cover(&[(1, 9), (2, 9), (3, 9)]), [9]);
        // Two stars that share an end: both centres.
        assert_eq!(smallest_cover(&[(1, 10), (1, 11), (2, 11), (2, 12)]), [1, 2]);
        // A complete 3 × 2 graph: the smaller side.
        let all: Vec<_> = (0..3).flat_map(|v| [(v, 10), (v, 11)]).collect();
        assert_eq!(smallest_cover(&all), [10, 11]);
    }

    #[test]
    fn random_covers_touch_every_edge_and_have_the_size_of_a_matching() {
        let mut state = 1;
        let mut next = |n: u64| random(&mut state) % n;
        for _ in 0..200 {
            let count = next(24);
            let edges: Vec<_> =
                (0..count).map(|_| (next(8) as usize, 100 + next(8) as usize)).collect();
            let cover = smallest_cover(&edges);
            assert!(edges.iter().all(|(v, w)| cover.contains(v) || cover.contains(w)));
            // Nothing smaller does: by trying all subsets of the low side.
            let least = (0..256_usize)
                .map(|low| {
                    let rest = edges.iter().filter(|(v, _)| low >> v & 1 == 0);
                    let mut high: Vec<_> = rest.map(|edge| edge.1).collect();
                    high.sort_unstable();
                    high.dedup();
                    low.count_ones() as usize + high.len()
                })
                .min();
            assert_eq!(Some(cover.len()), least, "{edges:?}");
        }
    }
}
