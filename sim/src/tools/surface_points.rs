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
    /// The bound points by their tetrahedra, those of one in the order of their numbers.
    order: Vec<usize>,
    groups: Vec<Group>,
}

/// The points of one tetrahedron.
struct Group {
    tet: TetId,
    /// Where they are in the order.
    range: Range<usize>,
    /// What they are bound to: the tetrahedron's vertices, and where these rest, m.
    vertices: [usize; 4],
    corners: [Vector3<f64>; 4],
}

impl SurfacePoints {
    /// Not bound yet.
    pub(super) fn new(rest: Vec<Vector3<f64>>, areas: Vec<Vector3<f64>>, reach: f64) -> Self {
        let bound = vec![None; rest.len()];
        Self { rest, areas, reach, bound, order: Vec::new(), groups: Vec::new() }
    }

    /// One more, not bound yet.
    pub(crate) fn add(&mut self, rest: Vector3<f64>, area: Vector3<f64>) {
        if self.areas.len() == self.rest.len() {
            self.areas.push(area);
        }
        self.rest.push(rest);
        self.bound.push(None);
    }

    /// How many there are, those that are not bound too.
    pub(super) fn len(&self) -> usize {
        self.rest.len()
    }

    /// Where they are at rest, m.
    pub(crate) fn rest(&self) -> &[Vector3<f64>] {
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

    /// The bound points, by the tetrahedra that carry them.
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// The tetrahedra that carry points, with theirs.
    pub fn groups(&self) -> impl Iterator<Item = (TetId, &[usize])> {
        self.groups.iter().map(|group| (group.tet, &self.order[group.range.clone()]))
    }

    /// Binds all points whose tetrahedron has changed. Cost: O(tetrahedra that carry points), and O(points +
    /// tetrahedra) if there are such points.
    pub fn bind(&mut self, state: &BodyState) {
        let stands = |group: &Group| {
            let element = state.body.element(group.tet);
            element.is_some_and(|element| {
                element.vertices == group.vertices
                    && element.vertices.map(|v| state.rest[v]) == group.corners
            })
        };
        for group in self.groups.iter().filter(|group| !stands(group)) {
            self.order[group.range.clone()].iter().for_each(|&i| self.bound[i] = None);
        }
        let lost: Vec<usize> = (0..self.rest.len()).filter(|&i| self.bound[i].is_none()).collect();
        if !lost.is_empty() {
            self.order.retain(|&i| self.bound[i].is_some());
            self.find(&lost, state);
            self.order.extend(lost.into_iter().filter(|&i| self.bound[i].is_some()));
            self.group(state);
        }
    }

    /// Has [`bind`](Self::bind) bind all points afresh.
    pub fn unbind(&mut self) {
        self.bound.fill(None);
        self.order.clear();
        self.groups.clear();
    }

    /// Binds the points `lost`, each to the tetrahedron in which its least weight is largest.
    fn find(&mut self, lost: &[usize], state: &BodyState) {
        let places: Vec<Vector3<f64>> = lost.iter().map(|&i| self.rest[i]).collect();
        let solid = state.body.elements().iter().filter(|e| !state.cell(e.tet).is_void);
        let carries = |tet, point: &ElementPoint| state.carries(tet, point.weights);
        let found = locate(&places, solid, &state.rest, self.reach, carries);
        lost.iter().zip(found).for_each(|(&i, bound)| self.bound[i] = bound);
    }

    /// Sorts the bound points by their tetrahedra.
    fn group(&mut self, state: &BodyState) {
        let Self { bound, order, groups, .. } = self;
        // Most are in order: a sort that finds runs only merges.
        order.sort_by_key(|&i| (bound[i].map(|(tet, _)| tet), i));
        groups.clear();
        for (at, &i) in order.iter().enumerate() {
            let Some((tet, ElementPoint { vertices, .. })) = bound[i] else { continue };
            match groups.last_mut() {
                Some(last) if last.tet == tet => last.range.end = at + 1,
                _ => {
                    let corners = vertices.map(|v| state.rest[v]);
                    groups.push(Group { tet, range: at..at + 1, vertices, corners });
                }
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
        for Group { vertices, range, .. } in &self.groups {
            let (low, high) = bounds(&vertices.map(|v| positions[v]), 0.0);
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
