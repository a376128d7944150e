//! Split requests: which older vertices must come first, and in what order.

use std::cmp::Reverse;

use super::delta::{MeshDelta, VertexId};
use super::forest::BisectionForest;
use super::kuhn::Point;
use super::lattice::Lattice;
use crate::bisection::BisectionError;

impl BisectionForest {
    /// The vertices that a split at `p` needs, oldest first, `p` last; empty if `p` is active.
    ///
    /// Splitting them in this order keeps the mesh conforming at every moment, so that a caller
    /// with little time may take them one by one. At most 28k − 42 of them for p of generation
    /// 3k ≥ 9, 2 to 4 on average in random refinement.
    pub fn closure(&self, p: Point) -> Vec<Point> {
        let mut found = Vec::new();
        self.closure_into(p, &mut found);
        found
    }

    /// Fills `found` with the closure of `p`.
    ///
    /// Cost: O(m log m) for m vertices, generation by generation, as every vertex depends on
    /// vertices of the generation before its own alone.
    pub(crate) fn closure_into(&self, p: Point, found: &mut Vec<Point>) {
        found.clear();
        if self.vertex_at(p).is_some() || !self.domain().lattice().contains(p) {
            return;
        }
        found.push(p);
        let mut begin = 0;
        while begin < found.len() {
            let end = found.len();
            for at in begin..end {
                found.extend(self.missing(found[at]));
            }
            // Descending, as the whole list is reversed at the end.
            found[end..].sort_unstable_by_key(|&q| Reverse(Lattice::key(q)));
            found.dedup();
            begin = end;
        }
        found.reverse();
    }

    /// True where a vertex of the forest is possible and not active.
    pub(crate) fn lacks(&self, p: Point) -> bool {
        let lattice = self.domain().lattice();
        lattice.contains(p)
            && lattice.generation(p) <= self.max_level()
            && self.vertex_at(p).is_none()
            && self.domain().contains(p)
    }

    /// Splits at `p` with its closure, calling `visit` after each vertex.
    ///
    /// # Errors
    /// [`BisectionError::NotSplittable`] if `p` is no midpoint of a tetrahedron above `max_level`;
    /// then nothing was split.
    pub fn split_with_closure(
        &mut self,
        p: Point,
        delta: &mut MeshDelta,
        mut visit: impl FnMut(&Self, &MeshDelta),
    ) -> Result<VertexId, BisectionError> {
        let mut vertex = Err(BisectionError::NotSplittable { point: p });
        if self.lacks(p) {
            for q in self.closure(p) {
                vertex = Ok(self.split(q, delta)?);
                visit(self, delta);
            }
        }
        vertex
    }

    /// Splits until every leaf has at least `level`.
    ///
    /// # Errors
    /// [`BisectionError::Level`] if `level` is beyond `max_level`.
    pub fn refine_uniformly(&mut self, level: u8) -> Result<(), BisectionError> {
        if level > self.max_level() {
            let limit = self.max_level();
            return Err(BisectionError::Level { what: "uniform level", level, limit });
        }
        let mut delta = MeshDelta::empty();
        for generation in 1..=level {
            for p in self.candidates() {
                if self.domain().lattice().generation(p) == generation {
                    self.split(p, &mut delta)?;
                }
            }
        }
        Ok(())
    }

    /// Merges all that may be merged, down to the start mesh.
    ///
    /// # Errors
    /// None on a valid forest: the errors of [`Self::merge`] are passed on.
    pub fn merge_all(&mut self) -> Result<(), BisectionError> {
        let mut delta = MeshDelta::empty();
        for generation in (self.start_level() + 1..=self.max_level()).rev() {
            let young: Vec<VertexId> =
                self.vertices().filter(|&v| self.generation(v) == generation).collect();
            for v in young {
                self.merge(v, &mut delta)?;
            }
        }
        Ok(())
    }
}
