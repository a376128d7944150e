//! Split requests that are served one vertex at a time, as far as the time of a frame goes.

use std::cmp::Ordering;

use super::delta::MeshDelta;
use super::forest::BisectionForest;
use super::kuhn::Point;
use crate::bisection::BisectionError;

/// A point to split at, and how much that is wanted.
#[derive(Clone, Copy, Debug)]
struct Request {
    priority: f64,
    point: Point,
}

impl Request {
    /// Larger priorities are better, then smaller z, y, x: no two points are equally good.
    fn rank(&self, other: &Self) -> Ordering {
        let place = |p: Point| [p[2], p[1], p[0]];
        self.priority
            .total_cmp(&other.priority)
            .then_with(|| place(other.point).cmp(&place(self.point)))
    }
}

/// Split requests to one forest, each with its closure: the best request first, and of its
/// closure the oldest vertex first, so that the mesh conforms after every vertex and a caller
/// may stop anywhere and go on in the next frame.
///
/// The forest may change in any way between two calls: what a request still needs is derived
/// anew then. Nothing is allocated once the queue has had its largest number of requests.
#[derive(Clone, Debug, Default)]
pub struct ClosureQueue {
    /// The best last.
    ranked: Vec<Request>,
    /// The same, in the order of the points.
    known: Vec<Request>,
    /// What `target` needs, the oldest last, when the forest had made `changes` changes.
    steps: Vec<Point>,
    target: Option<Point>,
    changes: u64,
}

impl ClosureQueue {
    /// An empty queue.
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty queue that holds `requests` without an allocation.
    pub fn with_capacity(requests: usize) -> Self {
        // 28k − 42 = 126 vertices at generation 18, the finest there is, and up to four
        // dependencies of each before duplicates go.
        const LARGEST_CLOSURE: usize = 5 * 126;
        Self {
            ranked: Vec::with_capacity(requests),
            known: Vec::with_capacity(requests),
            steps: Vec::with_capacity(LARGEST_CLOSURE),
            ..Self::default()
        }
    }

    /// Number of requests.
    pub fn len(&self) -> usize {
        self.ranked.len()
    }

    /// True without requests.
    pub fn is_empty(&self) -> bool {
        self.ranked.is_empty()
    }

    /// Forgets all requests and keeps the memory.
    pub fn clear(&mut self) {
        self.ranked.clear();
        self.known.clear();
        self.target = None;
    }

    /// All requests with their priorities, in the order of the points: pushed to an empty queue they make this one
    /// again.
    pub fn requests(&self) -> impl Iterator<Item = (Point, f64)> + '_ {
        self.known.iter().map(|r| (r.point, r.priority))
    }

    /// The request that is served next and its priority.
    pub fn best(&self) -> Option<(Point, f64)> {
        self.ranked.last().map(|r| (r.point, r.priority))
    }

    /// Asks for a split at `p`; a point that is known keeps the larger of its priorities. Returns
    /// whether it is new.
    ///
    /// Cost: O(log n) comparisons and up to 24 n bytes moved, n requests.
    ///
    /// # Errors
    /// [`BisectionError::PriorityNotFinite`] for NaN and infinities; the queue is unchanged then.
    pub fn push(&mut self, p: Point, priority: f64) -> Result<bool, BisectionError> {
        if !priority.is_finite() {
            return Err(BisectionError::PriorityNotFinite { point: p, value: priority });
        }
        // −0 and 0 are the same wish.
        let request = Request { priority: priority + 0.0, point: p };
        let is_new = match self.known.binary_search_by_key(&p, |r| r.point) {
            Ok(at) if self.known[at].priority >= request.priority => return Ok(false),
            Ok(_) => {
                self.remove(p);
                false
            }
            Err(_) => true,
        };
        let at = self.known.partition_point(|r| r.point < p);
        self.known.insert(at, request);
        let at = self.ranked.partition_point(|r| r.rank(&request).is_lt());
        self.ranked.insert(at, request);
        Ok(is_new)
    }

    /// Takes a request back; returns whether there was one. Cost: that of [`Self::push`].
    pub fn remove(&mut self, p: Point) -> bool {
        let Ok(at) = self.known.binary_search_by_key(&p, |r| r.point) else { return false };
        let request = self.known.remove(at);
        let at = self.ranked.partition_point(|r| r.rank(&request).is_lt());
        self.ranked.remove(at);
        true
    }

    /// The vertex to split at now: of the best request, the first of [`BisectionForest::closure`].
    /// The same one again until it is split. Requests that are done, or that `forest` can't
    /// fulfil (off its domain, beyond its finest level, beside a cut), are dropped when their turn comes.
    ///
    /// Cost: a few look-ups; the derivation of a closure where the best request or the forest
    /// changed otherwise than by the split asked for.
    pub fn next(&mut self, forest: &BisectionForest) -> Option<Point> {
        while let Some(&Request { point, .. }) = self.ranked.last() {
            if !forest.lacks(point) {
                self.remove(point);
                continue;
            }
            if !self.follow(forest, point) {
                forest.closure_into(point, &mut self.steps);
                self.steps.reverse();
                self.target = Some(point);
                self.changes = forest.changes;
                if self.steps.last().is_none_or(|&oldest| !forest.is_candidate(oldest)) {
                    self.target = None;
                    self.remove(point);
                    continue;
                }
            }
            return self.steps.last().copied();
        }
        None
    }

    /// Whether `steps` is still what `point` needs, but for the one just split, which goes.
    fn follow(&mut self, forest: &BisectionForest, point: Point) -> bool {
        let Some(&oldest) = self.steps.last().filter(|_| self.target == Some(point)) else {
            return false;
        };
        if forest.changes == self.changes {
            return forest.is_candidate(oldest);
        }
        // One change, and this vertex is there: the change was its split.
        if forest.changes != self.changes + 1 || forest.vertex_at(oldest).is_none() {
            return false;
        }
        self.steps.pop();
        self.changes = forest.changes;
        self.steps.last().is_some_and(|&next| forest.is_candidate(next))
    }

    /// Splits one vertex after the other until `budget` vertices came in, `until` is true
    /// (asked before each vertex: a clock, say), or no request is left; calls `visit` after each.
    /// Returns how many came in.
    ///
    /// # Errors
    /// None on a valid forest: the errors of [`BisectionForest::split`] are passed on.
    pub fn drain(
        &mut self,
        forest: &mut BisectionForest,
        budget: usize,
        mut until: impl FnMut() -> bool,
        delta: &mut MeshDelta,
        mut visit: impl FnMut(&BisectionForest, &MeshDelta),
    ) -> Result<usize, BisectionError> {
        for count in 0..budget {
            if until() {
                return Ok(count);
            }
            let Some(p) = self.next(forest) else { return Ok(count) };
            forest.split(p, delta)?;
            visit(forest, delta);
        }
        Ok(budget)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(queue: &mut ClosureQueue) -> Vec<Point> {
        let mut points = Vec::new();
        while let Some((p, _)) = queue.best() {
            points.push(p);
            assert!(queue.remove(p));
        }
        points
    }

    #[test]
    fn larger_priorities_come_first_then_smaller_keys() {
        let mut queue = ClosureQueue::new();
        for (p, priority) in
            [([1, 0, 0], 1.0), ([0, 1, 0], 1.0), ([5, 5, 5], -2.0), ([9, 9, 9], 3.0)]
        {
            assert!(queue.push(p, priority).unwrap());
        }
        assert_eq!(queue.len(), 4);
        assert_eq!(order(&mut queue), [[9, 9, 9], [1, 0, 0], [0, 1, 0], [5, 5, 5]]);
        assert!(queue.is_empty() && !queue.remove([9, 9, 9]));
    }

    #[test]
    fn requests_make_the_same_queue_again() {
        let mut queue = ClosureQueue::new();
        for (p, priority) in [([1, 0, 0], 1.0), ([0, 1, 0], 1.0), ([5, 5, 5], -2.0)] {
            queue.push(p, priority).unwrap();
        }
        let mut again = ClosureQueue::new();
        for (p, priority) in queue.requests() {
            again.push(p, priority).unwrap();
        }
        assert_eq!(order(&mut again), order(&mut queue));
    }

    #[test]
    fn a_known_point_keeps_its_larger_priority() {
        let mut queue = ClosureQueue::new();
        queue.push([1, 1, 1], 1.0).unwrap();
        queue.push([2, 2, 2], 2.0).unwrap();
        assert!(!queue.push([1, 1, 1], 0.5).unwrap());
        assert_eq!(queue.best(), Some(([2, 2, 2], 2.0)));
        assert!(!queue.push([1, 1, 1], 4.0).unwrap());
        assert_eq!((queue.best(), queue.len()), (Some(([1, 1, 1], 4.0)), 2));
        assert_eq!(order(&mut queue), [[1, 1, 1], [2, 2, 2]]);
    }

    #[test]
    fn priorities_are_numbers() {
        let mut queue = ClosureQueue::new();
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let error = queue.push([1, 2, 3], value).unwrap_err();
            assert!(matches!(error, BisectionError::PriorityNotFinite { point: [1, 2, 3], .. }));
        }
        assert!(queue.is_empty());
        // Negative zero is zero: the smaller key goes first.
        queue.push([0, 0, 1], 0.0).unwrap();
        queue.push([0, 0, 0], -0.0).unwrap();
        assert_eq!(queue.best(), Some(([0, 0, 0], 0.0)));
    }
}
