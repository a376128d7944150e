//! Refinement of a start mesh: where a closure asks for it, or where one tetrahedron has
//! several labels.

use super::delta::{MeshDelta, Tet};
use super::forest::BisectionForest;
use super::kuhn::{Point, extent};
use super::lattice::Lattice;
use crate::bisection::BisectionError;

/// Where refinement may begin; closures may leave it.
#[derive(Clone, Copy)]
pub enum Region<'a> {
    /// Everywhere.
    Everywhere,
    /// Tetrahedra whose bounding box meets the closed box from one lattice point to another.
    Box(Point, Point),
    /// Tetrahedra whose bounding box meets the closed ball around a centre, both in lattice units.
    Ball([f64; 3], f64),
    /// Tetrahedra with a corner, or the midpoint of their bisected edge, where this is true.
    /// What is smaller than the tetrahedra of the start mesh may be missed.
    Where(&'a dyn Fn(Point) -> bool),
}

impl Region<'_> {
    fn touches(&self, corners: &[Point; 4], midpoint: Point) -> bool {
        match self {
            Self::Everywhere => true,
            Self::Box(low, high) => (0..3).all(|axis| {
                let [first, last] = extent(corners, axis);
                first <= high[axis] && last >= low[axis]
            }),
            Self::Ball(centre, radius) => {
                let distance2: f64 = (0..3)
                    .map(|axis| {
                        let [first, last] = extent(corners, axis).map(f64::from);
                        centre[axis] - centre[axis].clamp(first, last)
                    })
                    .map(|away| away * away)
                    .sum();
                distance2 <= radius * radius
            }
            Self::Where(inside) => corners.iter().any(|&p| inside(p)) || inside(midpoint),
        }
    }
}

/// A question to a leaf of a forest.
pub type Wants<'a> = &'a dyn Fn(&BisectionForest, &Tet) -> bool;

/// What [`BisectionForest::refine_where`] or [`BisectionForest::refine_to_labels`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LabelRefinement {
    /// Vertices that came in, those of closures included.
    pub added: usize,
    /// Leaves in the region, above the level asked for, that are still to be split: 0 unless the
    /// limit on vertices ended the refinement.
    pub left: usize,
}

impl BisectionForest {
    /// Splits, with closure, every leaf in `region` that has more than one label in the forest's
    /// label tree, until it has none or lies at `max_level`, or the mesh would grow beyond
    /// `max_vertices`: [`Self::refine_where`] with that question.
    ///
    /// # Errors
    /// As [`Self::refine_where`].
    pub fn refine_to_labels(
        &mut self,
        max_level: u8,
        max_vertices: usize,
        region: Region<'_>,
    ) -> Result<LabelRefinement, BisectionError> {
        self.refine_where(max_level, max_vertices, region, &|forest, tet| {
            forest.tree().labels(tet.node).as_slice().len() > 1
        })
    }

    /// Splits, with closure, every leaf in `region` that `wants` it, until none does above
    /// `max_level`, or the mesh would grow beyond `max_vertices`.
    ///
    /// Largest tetrahedra first, those of one level in the order of their midpoints: the
    /// result depends on the mesh alone, not on its history, also where the limit ends the
    /// refinement. `wants` is given the forest as it is then (for corners and labels) and a
    /// leaf. Cost: O(n) questions per level for n leaves, and the splits.
    ///
    /// # Errors
    /// [`BisectionError::Level`] if `max_level` is beyond the forest's; then nothing was split.
    pub fn refine_where(
        &mut self,
        max_level: u8,
        max_vertices: usize,
        region: Region<'_>,
        wants: Wants<'_>,
    ) -> Result<LabelRefinement, BisectionError> {
        if max_level > self.max_level() {
            let (what, limit) = ("level of the refinement", self.max_level());
            return Err(BisectionError::Level { what, level: max_level, limit });
        }
        let before = self.vertex_count();
        let mut delta = MeshDelta::empty();
        loop {
            let (points, left) = self.coarsest_wanted(max_level, region, wants);
            let result = LabelRefinement { added: self.vertex_count() - before, left };
            if points.is_empty() {
                return Ok(result);
            }
            for p in points {
                let closure = self.closure(p);
                if self.vertex_count() + closure.len() > max_vertices {
                    let left = self.coarsest_wanted(max_level, region, wants).1;
                    return Ok(LabelRefinement { added: self.vertex_count() - before, left });
                }
                for q in closure {
                    self.split(q, &mut delta)?;
                }
            }
        }
    }

    /// The midpoints of the largest leaves to be split, each once, ascending keys, and the
    /// number of such leaves of all sizes.
    fn coarsest_wanted(
        &self,
        max_level: u8,
        region: Region<'_>,
        wants: Wants<'_>,
    ) -> (Vec<Point>, usize) {
        let mut points = Vec::new();
        let mut coarsest = max_level;
        let mut count = 0;
        for tet in self.leaves().filter(|tet| tet.level < max_level) {
            let Some(p) = self.refinement_point(tet.id) else { continue };
            let corners = tet.vertices.map(|v| self.point(v));
            if !region.touches(&corners, p) || !wants(self, &tet) {
                continue;
            }
            count += 1;
            if tet.level < coarsest {
                coarsest = tet.level;
                points.clear();
            }
            if tet.level == coarsest {
                points.push(p);
            }
        }
        points.sort_unstable_by_key(|&p| Lattice::key(p));
        points.dedup();
        (points, count)
    }
}
