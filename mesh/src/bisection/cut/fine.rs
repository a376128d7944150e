//! Finest tetrahedra, the faces between them, and which of them a point is in.

use crate::bisection::geometry::FACES;
use crate::bisection::kuhn::{Point, bisect, bisected_corner};

/// A face of a finest tetrahedron, known by the sum of its corners on the lattice of the finest level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FineFace(Point);

/// A finest tetrahedron: that of a voxel's size, or of the forest's finest level if that is smaller.
#[derive(Clone, Copy, Debug)]
pub struct FineTet {
    /// Its corners, on the lattice of the [finest level](crate::BisectionForest::finest_level).
    pub corners: [Point; 4],
    /// Its faces; face i is opposite corner i.
    pub faces: [FineFace; 4],
    /// Its dense label.
    pub label: u16,
}

impl FineFace {
    /// Whether it lies in the plane through three points.
    pub(super) fn is_in(self, [a, b, c]: [Point; 3]) -> bool {
        let [u, v] = [b, c].map(|p| [0, 1, 2].map(|i| i64::from(p[i] - a[i])));
        let w = [0, 1, 2].map(|i| i64::from(self.0[i] - 3 * a[i]));
        let across = |i: usize, j: usize| u[i] * v[j] - u[j] * v[i];
        across(1, 2) * w[0] + across(2, 0) * w[1] + across(0, 1) * w[2] == 0
    }
}

impl FineTet {
    /// Of these corners and label.
    pub(super) fn new(corners: &[Point; 4], label: u16) -> Self {
        let faces = FACES.map(|face| FineFace(sum(face.map(|i| corners[i]))));
        Self { corners: *corners, faces, label }
    }

    /// Whether it holds anything but void.
    pub fn is_solid(&self) -> bool {
        self.label != 0
    }
}

/// The finest tetrahedron in which a point lies, by the order of [`finest_in`](crate::BisectionForest::finest_in), of a leaf of
/// `level` where the point has the barycentric coordinates `weights`; for one outside of it the nearest in this sense.
pub fn finest_at(mut weights: [f64; 4], level: u8, finest_level: u8) -> usize {
    let mut number = 0;
    for level in level..finest_level {
        let (a, b) = (weights[0], weights[bisected_corner(level)]);
        let half = usize::from(a < b);
        (weights[0], weights[bisected_corner(level)]) = (a - b, b - a);
        weights = bisect(&weights, level, 2.0 * a.min(b))[half];
        number = 2 * number + half;
    }
    number
}

fn sum(points: [Point; 3]) -> Point {
    std::array::from_fn(|axis| points.iter().map(|p| p[axis]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bisection::kuhn::{midpoint, root_corners};

    /// The middle of each finest tetrahedron is found in it, by weights in the whole.
    #[test]
    fn middles_lie_where_they_are_found() {
        for (order, level) in [(0, 0u8), (3, 0), (5, 0), (1, 0)] {
            let root = root_corners([1, 0, 2], order, 4);
            let mut fine = vec![(
                root,
                [
                    [1.0, 0.0, 0.0, 0.0],
                    [0.0, 1.0, 0.0, 0.0],
                    [0.0, 0.0, 1.0, 0.0],
                    [0.0, 0.0, 0.0, 1.0],
                ],
            )];
            for level in level..5 {
                fine = fine
                    .into_iter()
                    .flat_map(|(corners, weights): ([Point; 4], [[f64; 4]; 4])| {
                        let [a, b] = [weights[0], weights[bisected_corner(level)]];
                        let z = std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
                        let [c, d] = bisect(&corners, level, midpoint(&corners, level));
                        let [u, v] = bisect(&weights, level, z);
                        [(c, u), (d, v)]
                    })
                    .collect();
            }
            for (i, (_, weights)) in fine.iter().enumerate() {
                let middle = std::array::from_fn(|k| weights.iter().map(|w| 0.25 * w[k]).sum());
                assert_eq!(finest_at(middle, 0, 5), i);
            }
        }
    }
}
