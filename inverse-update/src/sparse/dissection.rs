//! The elimination order: nested dissection by planes where the vertices have positions, minimum
//! degree where they have none.
//!
//! Minimum degree makes fewer blocks, but longer paths for a split or merge; and they
//! grow faster, because its tree has more branches that a split can join.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use super::pattern::Pattern;
use super::vertex_cover::smallest_cover;

/// Regions of at most so many vertices are not divided further.
const LEAF: usize = 8;

/// The least share of the vertices on the smaller side of a plane.
const SMALLEST_SIDE: f64 = 0.3;

/// Planes considered along one direction: more find hardly better ones.
const PLANES: usize = 3;

/// Planes of all directions for which the fewest separating vertices are found.
const TRIED: usize = 3;

/// Directions of planes: along the axes and the diagonals of the faces. Meshes of bisected cubes
/// have faces in the planes across all of them.
const DIRECTIONS: [[i32; 3]; 9] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, -1, 0],
    [1, 0, -1],
    [0, 1, -1],
    [1, 1, 0],
    [1, 0, 1],
    [0, 1, 1],
];

/// One number per direction.
type Along = [i32; DIRECTIONS.len()];

/// The vertices in the order of their elimination.
///
/// Cost: O(n log n) for the planes, some hundred edges per separating vertex for the covers.
/// # Source
/// George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10(2), 1973;
/// without places Amestoy, Davis, Duff, An approximate minimum degree ordering algorithm, 1996.
pub(crate) fn order(pattern: &Pattern) -> Vec<usize> {
    let mut keys = pattern.keys.clone();
    keys.sort_unstable();
    // Two vertices with one key: the keys are not positions.
    if keys.windows(2).any(|pair| pair[0] == pair[1]) {
        return minimum_degree(pattern);
    }
    let mut dissection = Dissection::new(pattern);
    dissection.divide(dissection.whole());
    dissection.order
}

/// The lattice point of a key, 3 × 21 bits with x lowest, along every direction.
fn place(key: u64) -> Along {
    let point = [0, 21, 42].map(|shift| (key >> shift) as i32 & 0x1f_ffff);
    DIRECTIONS.map(|direction| (0..3).map(|i| direction[i] * point[i]).sum())
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
    // It can only fail for lack of memory. Any order is right, this one is slow.
    if done.is_ok() { forward } else { (0..n).collect() }
}

const OUTSIDE: u8 = 0;
const INSIDE: u8 = 1;
const LOW: u8 = 2;
const HIGH: u8 = 3;
const BETWEEN: u8 = 4;

struct Dissection<'a> {
    pattern: &'a Pattern,
    places: Vec<Along>,
    /// The side of each vertex of the current region.
    side: Vec<u8>,
    order: Vec<usize>,
}

/// Vertices, sorted along every direction.
struct Region([Vec<usize>; DIRECTIONS.len()]);

impl Region {
    fn vertices(&self) -> &[usize] {
        &self.0[0]
    }

    fn len(&self) -> usize {
        self.vertices().len()
    }
}

/// A way to divide a region: vertices up to `last` along a direction are low.
#[derive(Clone, Copy)]
struct Plane {
    direction: usize,
    last: i32,
    /// The number of low vertices.
    low: usize,
    /// The number of vertices on either side with a neighbour on the other.
    ends: [usize; 2],
}

/// The path of an update runs through one side only: a separator costs its square, a larger side
/// less than that per vertex.
fn cost(between: usize, larger: usize, all: usize) -> f64 {
    (between as f64 + 1.0) * (larger as f64 / all as f64 + 0.5)
}

impl<'a> Dissection<'a> {
    fn new(pattern: &'a Pattern) -> Self {
        let n = pattern.vertices();
        let places = pattern.keys.iter().map(|&key| place(key)).collect();
        Self { pattern, places, side: vec![OUTSIDE; n], order: Vec::with_capacity(n) }
    }

    fn region(&self, vertices: &[usize]) -> Region {
        Region(std::array::from_fn(|d| {
            let mut sorted = vertices.to_vec();
            sorted.sort_unstable_by_key(|&v| (self.places[v][d], v));
            sorted
        }))
    }

    fn whole(&self) -> Region {
        self.region(&(0..self.places.len()).collect::<Vec<_>>())
    }

    /// Orders a region: its two sides first, their separator last.
    fn divide(&mut self, region: Region) {
        if region.len() <= LEAF {
            self.order.extend(region.vertices());
            return;
        }
        let between = self.separate(&region);
        let sides = [LOW, HIGH].map(|side| {
            let of = |sorted: &Vec<usize>| {
                sorted.iter().copied().filter(|&v| self.side[v] == side).collect()
            };
            Region(region.0.each_ref().map(of))
        });
        region.vertices().iter().for_each(|&v| self.side[v] = OUTSIDE);
        match between {
            Some(between) => {
                sides.into_iter().for_each(|side| self.divide(side));
                self.order.extend(between);
            }
            None => self.order.extend(region.vertices()),
        }
    }

    /// Marks the sides of the best division and returns its separator; `None` if there is none.
    fn separate(&mut self, region: &Region) -> Option<Vec<usize>> {
        let all = region.len();
        let mut planes = self.planes(region);
        // The vertices of the smaller end separate as well; mostly a few less do.
        let guess = |p: &Plane| cost(p.ends[0].min(p.ends[1]), p.low.max(all - p.low), all);
        planes.sort_by(|a, b| guess(a).total_cmp(&guess(b)));
        let mut best: Option<(f64, Plane, Vec<usize>)> = None;
        for &plane in planes.iter().take(TRIED) {
            let between = self.cut(region, plane);
            let low = region.vertices().iter().filter(|&&v| self.side[v] == LOW).count();
            let larger = low.max(all - between.len() - low);
            let cost = cost(between.len(), larger, all);
            if larger < all && best.as_ref().is_none_or(|(least, _, _)| cost < *least) {
                best = Some((cost, plane, between));
            }
        }
        let (_, plane, between) = best?;
        self.mark(region, plane);
        between.iter().for_each(|&v| self.side[v] = BETWEEN);
        Some(between)
    }

    /// Planes near the middle along every direction.
    fn planes(&mut self, region: &Region) -> Vec<Plane> {
        let mut planes: Vec<Plane> = Vec::with_capacity(PLANES * DIRECTIONS.len());
        (0..DIRECTIONS.len()).for_each(|d| planes.extend(self.planes_along(region, d)));
        region.vertices().iter().for_each(|&v| self.side[v] = INSIDE);
        for &v in region.vertices() {
            let place = self.places[v];
            let (mut least, mut most) = (place, place);
            for &w in self.pattern.neighbours(v) {
                if self.side[w as usize] == INSIDE {
                    let other = &self.places[w as usize];
                    (0..other.len()).for_each(|d| least[d] = least[d].min(other[d]));
                    (0..other.len()).for_each(|d| most[d] = most[d].max(other[d]));
                }
            }
            for plane in &mut planes {
                let (d, last) = (plane.direction, plane.last);
                plane.ends[0] += usize::from(place[d] <= last && last < most[d]);
                plane.ends[1] += usize::from(least[d] <= last && last < place[d]);
            }
        }
        planes
    }

    /// Planes near the median vertex, each between two different coordinates.
    fn planes_along(&self, region: &Region, direction: usize) -> Vec<Plane> {
        let sorted = &region.0[direction];
        let place = |i: usize| self.places[sorted[i]][direction];
        let n = sorted.len();
        let smallest = ((SMALLEST_SIDE * n as f64) as usize).max(1);
        let mut cuts: Vec<usize> = Vec::with_capacity(PLANES + 1);
        for distance in 0..n {
            // None in the middle: the next one will do.
            if cuts.len() >= PLANES || (distance + smallest > n / 2 && !cuts.is_empty()) {
                break;
            }
            let both = [n / 2 - distance.min(n / 2), n / 2 + distance];
            let sides = if distance == 0 { &both[..1] } else { &both[..] };
            cuts.extend(sides.iter().filter(|&&i| 0 < i && i < n && place(i - 1) < place(i)));
        }
        let plane = |low: usize| Plane { direction, last: place(low - 1), low, ends: [0; 2] };
        cuts.into_iter().take(PLANES).map(plane).collect()
    }

    fn mark(&mut self, region: &Region, plane: Plane) {
        for (i, &v) in region.0[plane.direction].iter().enumerate() {
            self.side[v] = if i < plane.low { LOW } else { HIGH };
        }
    }

    /// The fewest vertices that all edges across a plane end at; they are marked so.
    fn cut(&mut self, region: &Region, plane: Plane) -> Vec<usize> {
        self.mark(region, plane);
        let mut edges = Vec::new();
        for &v in &region.0[plane.direction][..plane.low] {
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

    /// Held vertices at some points, with springs along the steps at which a vertex has them.
    fn body(points: &[[i64; 3]], placed: bool, has: impl Fn(usize, [i64; 3]) -> bool) -> Pattern {
        let mut k = SparseStiffness::zeros(points.len(), 1).unwrap();
        if placed {
            let keys = points.iter().map(|p| (p[0] | p[1] << 21 | p[2] << 42) as u64);
            k.set_order_keys(&keys.collect::<Vec<_>>()).unwrap();
        }
        for (v, p) in points.iter().enumerate() {
            k.add(&[v], mat![[1.0]].as_ref()).unwrap();
            for (w, q) in points.iter().enumerate() {
                if has(v, std::array::from_fn(|i| q[i] - p[i])) {
                    k.add(&[v, w], mat![[1.0, -1.0], [-1.0, 1.0]].as_ref()).unwrap();
                }
            }
        }
        Pattern::of(&k)
    }

    /// A box of vertices, each tied to those one step along an axis and along one diagonal of every
    /// face, and every seventh to one two steps away, across planes.
    fn grid([x, y, z]: [i64; 3], placed: bool) -> Pattern {
        let point = |at: i64| [at % x, at / x % y, at / (x * y)];
        let points: Vec<[i64; 3]> = (0..x * y * z).map(point).collect();
        let near = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]];
        let far = [[2, 0, 0], [0, 2, 0]];
        body(&points, placed, |v, step| near.contains(&step) || (v % 7 == 0 && far.contains(&step)))
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
        let mut dissection = Dissection::new(&pattern);
        let some: Vec<usize> = (0..pattern.vertices()).filter(|v| v % 11 != 3).collect();
        let region = dissection.region(&some);
        let between = dissection.separate(&region).unwrap();
        let count = |wanted| some.iter().filter(|&&v| dissection.side[v] == wanted).count();
        // A plane across the longest side has 30 vertices.
        assert!(between.len() == count(BETWEEN) && between.len() < 60, "{}", between.len());
        assert!(count(LOW).min(count(HIGH)) as f64 > 0.5 * SMALLEST_SIDE * some.len() as f64);
        for &v in some.iter().filter(|&&v| dissection.side[v] == LOW) {
            for &w in pattern.neighbours(v) {
                assert_ne!(dissection.side[w as usize], HIGH, "{v} and {w}");
            }
        }
    }

    #[test]
    fn a_strip_across_the_axes_is_cut_across_itself() {
        // 16 × 5 vertices, each tied to its eight neighbours, turned by 45°.
        let place = |at: i64| [at / 5 + 4 - at % 5, at / 5 + at % 5, 0];
        let points: Vec<[i64; 3]> = (0..80).map(place).collect();
        let steps = [[1, 1, 0], [-1, 1, 0], [0, 2, 0], [2, 0, 0]];
        let pattern = body(&points, true, |_, step| steps.contains(&step));
        let mut dissection = Dissection::new(&pattern);
        let whole = dissection.whole();
        // Across the axes two staircases would be needed, 8 or more.
        assert_eq!(dissection.separate(&whole).map(|between| between.len()), Some(5));
    }

    #[test]
    fn points_in_one_place_and_separate_pieces_are_ordered_too() {
        assert_eq!(order(&grid([0, 0, 0], true)), [0; 0]);
        assert_eq!(order(&grid([1, 1, 1], true)), [0]);
        let points: Vec<[i64; 3]> = (0..40).map(|at| [at, 0, 0]).collect();
        assert_eq!(order(&body(&points, false, |_, _| false)).len(), 40);
        let apart = body(&points, true, |_, _| false);
        assert_eq!(Symbolic::new(&apart, order(&apart)).panels.len(), 40);
    }
}
