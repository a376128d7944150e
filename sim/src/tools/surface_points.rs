//! Points of a body, mostly of its surface, carried along by the coarse mesh.

use std::ops::Range;

use nalgebra::Vector3;
use yawara_corot::{ElementPoint, locate};
use yawara_mesh::TetId;

use crate::body::BodyState;

/// Points of the surface (for a load on material: of the voxels) at rest, each bound to the coarse tetrahedron around it by its barycentric
/// weights.
///
/// Only tetrahedra that hold some material carry points. A point just outside of all of them (the
/// surface is smoother than the voxels) takes the nearest, with extrapolated weights. A point that
/// is farther from any than a voxel is not bound, and nothing acts on it.
pub struct SurfacePoints {
    rest: Vec<Vector3<f64>>,
    /// Area vectors, outward, m²; empty where no tool needs them.
    areas: Vec<Vector3<f64>>,
    reach: f64,
    bound: Vec<Option<(TetId, ElementPoint)>>,
    /// The bound points, those of one tetrahedron together.
    order: Vec<usize>,
    groups: Vec<(TetId, Range<usize>)>,
}

impl SurfacePoints {
    /// Not bound yet.
    pub(super) fn new(rest: Vec<Vector3<f64>>, areas: Vec<Vector3<f64>>, reach: f64) -> Self {
        let bound = vec![None; rest.len()];
        Self { rest, areas, reach, bound, order: Vec::new(), groups: Vec::new() }
    }

    /// How many there are, those that are not bound too.
    pub(super) fn len(&self) -> usize {
        self.rest.len()
    }

    /// Where they are at rest, m.
    pub(super) fn rest(&self) -> &[Vector3<f64>] {
        &self.rest
    }

    /// A point as the mesh carries it.
    pub fn point(&self, i: usize) -> Option<&ElementPoint> {
        self.bound[i].as_ref().map(|(_, point)| point)
    }

    /// The area vector of a point, outward at rest, m².
    pub fn area(&self, i: usize) -> Vector3<f64> {
        self.areas.get(i).copied().unwrap_or_default()
    }

    /// Points in the order of [`groups`](Self::groups).
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// The tetrahedra that carry points, with where theirs are in [`order`](Self::order).
    pub fn groups(&self) -> &[(TetId, Range<usize>)] {
        &self.groups
    }

    /// Binds all points whose tetrahedron has changed. Cost: O(points), and O(tetrahedra) if
    /// there are such points.
    pub fn bind(&mut self, state: &BodyState) {
        let stands = |(tet, point): (TetId, ElementPoint), at: &Vector3<f64>| {
            let element = state.body.element(tet);
            element
                .is_some_and(|element| point.is_same(&ElementPoint::new(element, &state.rest, at)))
        };
        let mut lost: Vec<usize> = Vec::new();
        for i in 0..self.rest.len() {
            let kept = self.bound[i].is_some_and(|bound| stands(bound, &self.rest[i]));
            if !kept {
                lost.push(i);
            }
        }
        if !lost.is_empty() {
            self.find(&lost, state);
            self.group();
        }
    }

    /// Has [`bind`](Self::bind) bind all points afresh.
    pub fn unbind(&mut self) {
        self.bound.fill(None);
    }

    /// Binds the points `lost`, each to the tetrahedron in which its least weight is largest.
    fn find(&mut self, lost: &[usize], state: &BodyState) {
        let places: Vec<Vector3<f64>> = lost.iter().map(|&i| self.rest[i]).collect();
        let solid = state.body.elements().iter().filter(|e| !state.cell(e.tet).is_void);
        let found = locate(&places, solid, &state.rest, self.reach);
        lost.iter().zip(found).for_each(|(&i, bound)| self.bound[i] = bound);
    }

    fn group(&mut self) {
        self.order = (0..self.rest.len()).filter(|&i| self.bound[i].is_some()).collect();
        let tet = |i: usize| self.bound[i].map(|(tet, _)| tet);
        self.order.sort_by_key(|&i| tet(i));
        self.groups.clear();
        for (at, &i) in self.order.iter().enumerate() {
            let Some(tet) = tet(i) else { continue };
            match self.groups.last_mut() {
                Some((last, range)) if *last == tet => range.end = at + 1,
                _ => self.groups.push((tet, at..at + 1)),
            }
        }
    }

    /// Calls `visit` with every bound point that may lie within `distance` of `centre`, and perhaps
    /// others: those of the tetrahedra whose bounding box, widened by the reach of extrapolation,
    /// comes that near. Cost: O(tetrahedra that carry points).
    pub fn each_near(
        &self,
        positions: &[Vector3<f64>],
        centre: &Vector3<f64>,
        distance: f64,
        mut visit: impl FnMut(usize, &ElementPoint),
    ) {
        let wide = distance + self.reach;
        for (_, range) in &self.groups {
            let Some(first) = self.point(self.order[range.start]) else { continue };
            let (low, high) = bounds(&first.vertices.map(|v| positions[v]), 0.0);
            let apart = |i: usize| low[i] > centre[i] + wide || high[i] < centre[i] - wide;
            if (0..3).any(apart) {
                continue;
            }
            for &i in &self.order[range.clone()] {
                if let Some(point) = self.point(i) {
                    visit(i, point);
                }
            }
        }
    }
}

/// The box around a tetrahedron, wider by `reach` on each side.
fn bounds(corners: &[Vector3<f64>; 4], reach: f64) -> (Vector3<f64>, Vector3<f64>) {
    let low = corners.iter().fold(corners[0], |low, x| low.inf(x));
    let high = corners.iter().fold(corners[0], |high, x| high.sup(x));
    (low.add_scalar(-reach), high.add_scalar(reach))
}
