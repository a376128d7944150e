//! Points of a body's surface, carried along by the coarse mesh.

use std::ops::Range;

use nalgebra::Vector3;
use yawara_corot::{Element, SurfacePoint};
use yawara_mesh::TetId;

use crate::body::BodyState;

/// Weights that are found again after a change of the mesh and differ by more than this belong to
/// another place.
const SAME: f64 = 1e-9;

/// Points of the surface at rest, each bound to the coarse tetrahedron around it by its barycentric
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
    bound: Vec<Option<(TetId, SurfacePoint)>>,
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

    /// A point as the mesh carries it.
    pub fn point(&self, i: usize) -> Option<&SurfacePoint> {
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
    pub(crate) fn bind(&mut self, state: &BodyState) {
        let stands = |tet: TetId, at: &Vector3<f64>, point: &SurfacePoint| {
            state.body.element(tet).is_some_and(|element| {
                let now = weights(element, state, at);
                element.vertices == point.vertices
                    && now.iter().zip(point.weights).all(|(a, b)| (a - b).abs() <= SAME)
            })
        };
        let mut lost: Vec<usize> = Vec::new();
        for i in 0..self.rest.len() {
            let kept = self.bound[i].is_some_and(|(tet, point)| stands(tet, &self.rest[i], &point));
            if !kept {
                lost.push(i);
            }
        }
        if !lost.is_empty() {
            self.find(&mut lost, state);
            self.group();
        }
    }

    /// Binds the points `lost`, each to the tetrahedron in which its least weight is largest.
    fn find(&mut self, lost: &mut [usize], state: &BodyState) {
        lost.sort_by(|&a, &b| self.rest[a].x.total_cmp(&self.rest[b].x));
        lost.iter().for_each(|&i| self.bound[i] = None);
        let mut inside = vec![f64::NEG_INFINITY; self.rest.len()];
        for element in state.body.elements() {
            if state.cell(element.tet).is_void {
                continue;
            }
            let (low, high) = bounds(&element.vertices.map(|v| state.rest[v]), self.reach);
            let first = lost.partition_point(|&i| self.rest[i].x < low.x);
            for &i in &lost[first..] {
                let x = &self.rest[i];
                if x.x > high.x {
                    break;
                }
                if x.y < low.y || x.y > high.y || x.z < low.z || x.z > high.z {
                    continue;
                }
                let weights = weights(element, state, x);
                let least = weights.iter().copied().fold(f64::INFINITY, f64::min);
                // On a face the first tetrahedron wins, so that rounding does not decide.
                if least > inside[i] + SAME {
                    inside[i] = least;
                    let point = SurfacePoint { vertices: element.vertices, weights };
                    self.bound[i] = Some((element.tet, point));
                }
            }
        }
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
        mut visit: impl FnMut(usize, &SurfacePoint),
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

/// λ_a(x) = ¼ + ∇λ_a · (x − centroid).
fn weights(element: &Element, state: &BodyState, x: &Vector3<f64>) -> [f64; 4] {
    let centroid = element.vertices.iter().map(|&v| state.rest[v]).sum::<Vector3<f64>>() * 0.25;
    element.geometry.gradients.map(|gradient| 0.25 + gradient.dot(&(x - centroid)))
}
