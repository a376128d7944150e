//! The elimination order: nested dissection by planes where the vertices have places, minimum
//! degree where they have none.
//!
//! Minimum degree makes fewer blocks, but longer paths, which a split or merge has to walk; and
//! they grow faster, because its tree has more branches that a split can join.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use super::cover::smallest_cover;
use super::pattern::Pattern;

/// Parts of at most so many vertices are not cut any more.
const LEAF: usize = 8;

/// A plane may leave this part of the vertices on its smaller side.
const SMALLEST_SIDE: f64 = 0.3;

/// Planes tried along one axis: more find hardly better ones.
const PLANES: usize = 7;

/// The vertices in the order of their elimination: first to go, first listed.
///
/// Cost: O(n log n) for the planes, some hundred edges per separating vertex for the covers.
/// # Source
/// George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10(2), 1973;
/// without places Amestoy, Davis, Duff, An approximate minimum degree ordering algorithm, 1996.
pub(crate) fn order(pattern: &Pattern) -> Vec<usize> {
    let n = pattern.vertices();
    let mut keys = pattern.keys.clone();
    keys.sort_unstable();
    // Two vertices in one place: these are not places.
    if keys.windows(2).any(|pair| pair[0] == pair[1]) {
        return minimum_degree(pattern);
    }
    let mut dissection = Dissection {
        pattern,
        points: pattern.keys.iter().map(|&key| point(key)).collect(),
        side: vec![OUTSIDE; n],
        order: Vec::with_capacity(n),
    };
    dissection.divide((0..n).collect());
    dissection.order
}

/// The lattice point of a key: 3 × 21 bits, x lowest.
fn point(key: u64) -> [u32; 3] {
    [0, 21, 42].map(|shift| (key >> shift) as u32 & 0x1f_ffff)
}

fn minimum_degree(pattern: &Pattern) -> Vec<usize> {
    let n = pattern.vertices();
    let starts: Vec<usize> = pattern.starts.clone();
    let rows: Vec<usize> = pattern.columns.iter().map(|&j| j as usize).collect();
    let graph = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
    let (mut forward, mut inverse) = (vec![0; n], vec![0; n]);
    let mut memory = MemBuffer::new(amd::order_scratch::<usize>(n, rows.len()));
    let done = amd::order(
        &mut forward,
        &mut inverse,
        graph,
        amd::Control::default(),
        MemStack::new(&mut memory),
    );
    // It fails for want of memory alone; any order is right, this one is only slow.
    if done.is_ok() { forward } else { (0..n).collect() }
}

const OUTSIDE: u8 = 0;
const LOW: u8 = 1;
const HIGH: u8 = 2;
const BETWEEN: u8 = 3;

struct Dissection<'a> {
    pattern: &'a Pattern,
    points: Vec<[u32; 3]>,
    /// Of the part at hand: on which side each of its vertices is.
    side: Vec<u8>,
    order: Vec<usize>,
}

/// A way to cut a part: vertices up to `last` along `axis` are low.
#[derive(Clone, Copy)]
struct Plane {
    axis: usize,
    last: u32,
}

impl Dissection<'_> {
    /// Orders a part: its two sides first, what separates them last.
    fn divide(&mut self, part: Vec<usize>) {
        if part.len() <= LEAF {
            self.order.extend(part);
            return;
        }
        let between = self.separate(&part);
        let of = |side: u8| -> Vec<usize> {
            part.iter().copied().filter(|&v| self.side[v] == side).collect()
        };
        let (low, high) = (of(LOW), of(HIGH));
        part.iter().for_each(|&v| self.side[v] = OUTSIDE);
        match between {
            Some(between) => {
                self.divide(low);
                self.divide(high);
                self.order.extend(between);
            }
            None => self.order.extend(part),
        }
    }

    /// Marks the sides of the best cut; the vertices between them, none if there is no cut.
    fn separate(&mut self, part: &[usize]) -> Option<Vec<usize>> {
        let mut best: Option<(f64, Plane, Vec<usize>)> = None;
        for axis in 0..3 {
            for plane in self.planes(part, axis) {
                let between = self.cut(part, plane);
                let low = part.iter().filter(|&&v| self.side[v] == LOW).count();
                let rest = part.len() - between.len();
                let larger = low.max(rest - low) as f64;
                if larger >= part.len() as f64 {
                    continue;
                }
                // An update walks up one side only: a separator costs its square, a side less
                // than that for every vertex more.
                let cost = (between.len() as f64 + 1.0) * (larger / part.len() as f64 + 0.5);
                if best.as_ref().is_none_or(|(least, _, _)| cost < *least) {
                    best = Some((cost, plane, between));
                }
            }
        }
        let (_, plane, between) = best?;
        self.mark(part, plane);
        between.iter().for_each(|&v| self.side[v] = BETWEEN);
        Some(between)
    }

    /// Planes near the middle, each behind another coordinate.
    fn planes(&self, part: &[usize], axis: usize) -> Vec<Plane> {
        let mut places: Vec<u32> = part.iter().map(|&v| self.points[v][axis]).collect();
        places.sort_unstable();
        let n = places.len();
        let smallest = (SMALLEST_SIDE * n as f64) as usize;
        // Behind place i, the first of its coordinate to be followed by another one.
        let mut cuts: Vec<usize> = (smallest.max(1)..=n - smallest.max(1))
            .filter(|&i| places[i - 1] < places[i])
            .collect();
        if cuts.is_empty() {
            cuts = (1..n).filter(|&i| places[i - 1] < places[i]).collect();
        }
        cuts.sort_by_key(|&i| i.abs_diff(n / 2));
        cuts.truncate(PLANES);
        cuts.into_iter().map(|i| Plane { axis, last: places[i - 1] }).collect()
    }

    fn mark(&mut self, part: &[usize], plane: Plane) {
        for &v in part {
            self.side[v] = if self.points[v][plane.axis] <= plane.last { LOW } else { HIGH };
        }
    }

    /// The fewest vertices that all edges across a plane end at; they are marked so.
    fn cut(&mut self, part: &[usize], plane: Plane) -> Vec<usize> {
        self.mark(part, plane);
        let mut edges = Vec::new();
        for &v in part.iter().filter(|&&v| self.side[v] == LOW) {
            for &w in self.pattern.neighbours(v) {
                if self.side[w as usize] == HIGH {
                    edges.push((v, w as usize));
                }
            }
        }
        let between = smallest_cover(&edges);
        between.iter().for_each(|&v| self.side[v] = BETWEEN);
        between
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SparseStiffness;
    use crate::sparse::symbolic::{Symbolic, blocks};
    use faer::mat;

    /// A box of vertices, each tied to those one step along an axis and along one diagonal of every
    /// face, and every seventh to one two steps away, across planes.
    fn grid(size: [u64; 3], placed: bool) -> Pattern {
        let number = |[x, y, z]: [u64; 3]| (x + size[0] * (y + size[1] * z)) as usize;
        let mut k = SparseStiffness::zeros(size.iter().product::<u64>() as usize, 1).unwrap();
        let mut keys = Vec::new();
        for p in (0..size[2])
            .flat_map(|z| (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| [x, y, z])))
        {
            keys.push(p[0] | p[1] << 21 | p[2] << 42);
            let far = [[2, 0, 0], [0, 2, 0]].into_iter().filter(|_| number(p) % 7 == 0);
            let near = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]];
            for step in near.into_iter().chain(far) {
                let q: [u64; 3] = std::array::from_fn(|i| p[i] + step[i]);
                if (0..3).all(|i| q[i] < size[i]) {
                    let spring = mat![[1.0, -1.0], [-1.0, 1.0]];
                    k.add(&[number(p), number(q)], spring.as_ref()).unwrap();
                }
            }
            k.add(&[number(p)], mat![[1.0]].as_ref()).unwrap();
        }
        if placed {
            k.set_order_keys(&keys).unwrap();
        }
        Pattern::of(&k)
    }

    fn total(symbolic: &Symbolic) -> usize {
        symbolic.panels.iter().map(|panel| blocks(panel.width, panel.rows.len())).sum()
    }

    #[test]
    fn orders_are_permutations_and_save_blocks() {
        for placed in [true, false] {
            let pattern = grid([9, 8, 7], placed);
            let found = order(&pattern);
            let mut sorted = found.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..pattern.vertices()));
            let symbolic = Symbolic::new(&pattern, found);
            let by_rows = Symbolic::new(&pattern, (0..pattern.vertices()).collect());
            let (found, natural) = (total(&symbolic), total(&by_rows));
            assert!(3 * found < 2 * natural, "placed: {placed}, {found} of {natural}");
        }
    }

    #[test]
    fn separators_separate() {
        let pattern = grid([10, 6, 5], true);
        let points = pattern.keys.iter().map(|&key| point(key)).collect();
        let side = vec![OUTSIDE; pattern.vertices()];
        let mut dissection = Dissection { pattern: &pattern, points, side, order: Vec::new() };
        let part: Vec<usize> = (0..pattern.vertices()).filter(|v| v % 11 != 3).collect();
        let between = dissection.separate(&part).unwrap();
        let count = |wanted| part.iter().filter(|&&v| dissection.side[v] == wanted).count();
        // A plane across the longest side has 30 vertices.
        assert!(between.len() == count(BETWEEN) && between.len() < 60, "{}", between.len());
        assert!(count(LOW).min(count(HIGH)) as f64 > 0.5 * SMALLEST_SIDE * part.len() as f64);
        for &v in part.iter().filter(|&&v| dissection.side[v] == LOW) {
            for &w in pattern.neighbours(v) {
                assert_ne!(dissection.side[w as usize], HIGH, "{v} and {w}");
            }
        }
    }

    #[test]
    fn points_in_one_place_and_separate_pieces_are_ordered_too() {
        assert_eq!(order(&grid([0, 0, 0], true)), [0; 0]);
        assert_eq!(order(&grid([1, 1, 1], true)), [0]);
        let mut apart = SparseStiffness::zeros(40, 1).unwrap();
        for v in 0..40 {
            apart.add(&[v], mat![[1.0]].as_ref()).unwrap();
        }
        assert_eq!(order(&Pattern::of(&apart)).len(), 40);
        apart.set_order_keys(&(0..40).collect::<Vec<_>>()).unwrap();
        let symbolic = Symbolic::new(&Pattern::of(&apart), order(&Pattern::of(&apart)));
        assert_eq!(symbolic.panels.len(), 40);
    }
}
