//! The elimination order: nested dissection by planes where the vertices have places, minimum
//! degree where they have none.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use super::cover::smallest_cover;
use super::pattern::Pattern;

/// Parts of at most so many vertices are not cut any more.
const LEAF: usize = 12;

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
    let placed = pattern.keys.iter().any(|&key| key != pattern.keys[0]);
    if !placed {
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
        let Some(between) = self.separate(&part) else {
            self.order.extend(part);
            return;
        };
        let of = |side: u8| -> Vec<usize> {
            part.iter().copied().filter(|&v| self.side[v] == side).collect()
        };
        let (low, high) = (of(LOW), of(HIGH));
        part.iter().for_each(|&v| self.side[v] = OUTSIDE);
        self.divide(low);
        self.divide(high);
        self.order.extend(between);
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
