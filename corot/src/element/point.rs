//! A point of the material by its element, and which element a point at rest lies in.

use nalgebra::Vector3;
use yawara_mesh::TetId;

use super::bins::Bins;
use super::tetrahedron::Element;
use crate::field::Field;

/// Barycentric coordinates that differ by no more than this are of one place.
const SAME: f64 = 1e-9;

/// Corners of a tetrahedron's edges.
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// A point of the material: x = Σ λ_i x_i over the corners of its coarse tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElementPoint {
    /// Corners, vertex numbers.
    pub vertices: [usize; 4],
    /// Barycentric coordinates λ, of sum 1.
    pub weights: [f64; 4],
}

impl ElementPoint {
    /// Where it is when the vertices are at `positions`.
    pub fn position(&self, positions: &Field) -> Vector3<f64> {
        (0..4).map(|i| self.weights[i] * positions[self.vertices[i]]).sum()
    }

    /// The point `x` (rest, m) by `element`, whose vertices rest at `rest` (by vertex number, m):
    /// λ_a = ¼ + ∇λ_a · (x − centroid), also where it lies outside.
    pub fn new(element: &Element, rest: &[Vector3<f64>], x: &Vector3<f64>) -> Self {
        let centroid = element.vertices.iter().map(|&v| rest[v]).sum::<Vector3<f64>>() * 0.25;
        let weight = |gradient: Vector3<f64>| 0.25 + gradient.dot(&(x - centroid));
        Self { vertices: element.vertices, weights: element.geometry.gradients.map(weight) }
    }

    /// True if `other` is the same place of the same element, up to rounding.
    pub fn is_same(&self, other: &Self) -> bool {
        let mut pairs = self.weights.iter().zip(other.weights);
        self.vertices == other.vertices && pairs.all(|(a, b)| (a - b).abs() <= SAME)
    }
}

/// For each point (rest, m) the element in which its least λ is largest, the first of several, out of those that
/// `carries` it (an element of a body that is cut holds a part of its material);
/// none where every element's box, wider by `reach` (m) on each side, is missed.
///
/// Cost: O(points), and a look at each point whose bin meets an element's wider box.
pub fn locate<'a>(
    points: &[Vector3<f64>],
    elements: impl Iterator<Item = &'a Element>,
    rest: &[Vector3<f64>],
    reach: f64,
    carries: impl Fn(TetId, &ElementPoint) -> bool,
) -> Vec<Option<(TetId, ElementPoint)>> {
    let elements: Vec<&Element> = elements.collect();
    let found = elements_of(points, &elements, rest, reach, carries);
    let bound = |(x, found): (&Vector3<f64>, Option<u32>)| {
        let element = elements[found? as usize];
        Some((element.tet, ElementPoint::new(element, rest, x)))
    };
    points.iter().zip(found).map(bound).collect()
}

/// The same by its place in `elements`.
pub(crate) fn elements_of(
    points: &[Vector3<f64>],
    elements: &[&Element],
    rest: &[Vector3<f64>],
    reach: f64,
    carries: impl Fn(TetId, &ElementPoint) -> bool,
) -> Vec<Option<u32>> {
    let bins = Bins::new(points);
    let mut found = vec![None; points.len()];
    let mut inside = vec![f64::NEG_INFINITY; points.len()];
    for (number, element) in elements.iter().enumerate() {
        let corners = element.vertices.map(|v| rest[v]);
        let low = corners.iter().fold(corners[0], |low, x| low.inf(x)).add_scalar(-reach);
        let high = corners.iter().fold(corners[0], |high, x| high.sup(x)).add_scalar(reach);
        for i in bins.near(&low, &high) {
            let x = &points[i];
            if (0..3).any(|axis| x[axis] < low[axis] || x[axis] > high[axis]) {
                continue;
            }
            let here = ElementPoint::new(element, rest, x);
            let least = here.weights.iter().copied().fold(f64::INFINITY, f64::min);
            // On a face the first element wins, so that rounding does not decide.
            if least > inside[i] + SAME && carries(element.tet, &here) {
                (inside[i], found[i]) = (least, Some(number as u32));
            }
        }
    }
    found
}
