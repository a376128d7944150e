//! Refinement towards what a volume shows: split where one tetrahedron has several labels.

use crate::delta::{MeshDelta, Tet};
use crate::error::MeshError;
use crate::forest::BisectionForest;
use crate::kuhn::Point;
use crate::lattice::Lattice;

/// Where refinement may begin; closures may leave it.
#[derive(Clone, Copy)]
pub enum Region<'a> {
    /// Everywhere.
    Everywhere,
    /// Tetrahedra whose bounding box meets the closed box from one lattice point to another.
    Box(Point, Point),
    /// Tetrahedra with a corner, or the midpoint of their bisected edge, where this is true.
    /// What is smaller than the tetrahedra of the start mesh may be missed.
    Where(&'a dyn Fn(Point) -> bool),
}

impl Region<'_> {
    fn touches(&self, corners: &[Point; 4], midpoint: Point) -> bool {
        match self {
            Self::Everywhere => true,
            Self::Box(low, high) => (0..3).all(|axis| {
                let along = corners.map(|p| p[axis]);
                let [first, last] =
                    along.iter().fold([i32::MAX, i32::MIN], |[a, b], &c| [a.min(c), b.max(c)]);
                first <= high[axis] && last >= low[axis]
            }),
            Self::Where(inside) => corners.iter().any(|&p| inside(p)) || inside(midpoint),
        }
    }
}

/// What [`BisectionForest::refine_to_labels`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LabelRefinement {
    /// Vertices that came in, those of closures included.
    pub added: usize,
    /// Leaves in the region that still have several labels above the level asked for: 0 unless
    /// the limit on vertices ended the refinement.
    pub left: usize,
}

impl BisectionForest {
    /// Splits, with closure, every leaf in `region` that has more than one label in the forest's
    /// label tree, until it has none or lies at `max_level`, or the mesh would grow beyond
    /// `max_vertices`.
    ///
    /// Largest tetrahedra first, those of one level in the order of their midpoints: the
    /// result depends on the mesh alone, not on its history, also where the limit ends the
    /// refinement. Cost: O(n) per level
    /// for n leaves, and the splits.
    ///
    /// # Errors
    /// [`MeshError::Level`] if `max_level` is beyond the forest's; then nothing was split.
    pub fn refine_to_labels(
        &mut self,
        max_level: u8,
        max_vertices: usize,
        region: Region<'_>,
    ) -> Result<LabelRefinement, MeshError> {
        if max_level > self.max_level() {
            let limit = self.max_level();
            return Err(MeshError::Level { what: "level of the labels", level: max_level, limit });
        }
        let before = self.vertex_count();
        let mut delta = MeshDelta::empty();
        loop {
            let (points, left) = self.coarsest_mixed(max_level, region);
            let result = LabelRefinement { added: self.vertex_count() - before, left };
            if points.is_empty() {
                return Ok(result);
            }
            for p in points {
                let closure = self.closure(p);
                if self.vertex_count() + closure.len() > max_vertices {
                    let left = self.coarsest_mixed(max_level, region).1;
                    return Ok(LabelRefinement { added: self.vertex_count() - before, left });
                }
                for q in closure {
                    self.split(q, &mut delta)?;
                }
            }
        }
    }

    /// The midpoints of the largest leaves with several labels, each once, ascending keys, and
    /// the number of such leaves of all sizes.
    fn coarsest_mixed(&self, max_level: u8, region: Region<'_>) -> (Vec<Point>, usize) {
        let mut points = Vec::new();
        let mut coarsest = max_level;
        let mut count = 0;
        for tet in self.leaves() {
            let Some(p) = self.mixed(&tet, max_level, region) else { continue };
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

    /// The midpoint of a leaf that is to be split.
    fn mixed(&self, tet: &Tet, max_level: u8, region: Region<'_>) -> Option<Point> {
        let several = self.tree().labels(tet.node).as_slice().len() > 1;
        if tet.level >= max_level || !several {
            return None;
        }
        let p = self.refinement_point(tet.id)?;
        region.touches(&tet.vertices.map(|v| self.point(v)), p).then_some(p)
    }
}
