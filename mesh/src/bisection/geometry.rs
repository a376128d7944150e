//! Lengths: where lattice points lie in space, and the quality of tetrahedra.

use nalgebra::{Matrix3, Vector3};

use super::kuhn::Point;

/// Where a lattice lies in solver coordinates (metres along the voxel axes).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Position of lattice point (0,0,0), m.
    pub origin: Vector3<f64>,
    /// Length of a lattice unit, m.
    pub unit: f64,
}

impl Placement {
    /// Position of a lattice point, m.
    pub fn position(&self, p: Point) -> Vector3<f64> {
        self.origin + self.unit * Vector3::new(p[0].into(), p[1].into(), p[2].into())
    }
}

/// Measures of a tetrahedron's shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Three inradii over the circumradius: 1 for the regular tetrahedron, 0 when flat.
    pub radius_ratio: f64,
    /// Circumradius over the shortest edge: √6/4 for the regular tetrahedron.
    pub circumradius_over_shortest_edge: f64,
}

impl Quality {
    /// The measures of four corners in any order.
    pub fn of(x: &[Vector3<f64>; 4]) -> Self {
        let (a, b, c) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let volume6 = a.cross(&b).dot(&c).abs();
        let offset = a.norm_squared() * b.cross(&c)
            + b.norm_squared() * c.cross(&a)
            + c.norm_squared() * a.cross(&b);
        let circumradius = offset.norm() / (2.0 * volume6);
        let face_area2 = |i: usize, j: usize, k: usize| (x[j] - x[i]).cross(&(x[k] - x[i])).norm();
        let surface2 =
            face_area2(0, 1, 2) + face_area2(0, 1, 3) + face_area2(0, 2, 3) + face_area2(1, 2, 3);
        let inradius = volume6 / surface2;
        let shortest = edge_lengths(x).fold(f64::INFINITY, f64::min);
        Self {
            radius_ratio: 3.0 * inradius / circumradius,
            circumradius_over_shortest_edge: circumradius / shortest,
        }
    }

    /// The worse of two in each measure.
    pub fn worse(self, other: Self) -> Self {
        Self {
            radius_ratio: self.radius_ratio.min(other.radius_ratio),
            circumradius_over_shortest_edge: self
                .circumradius_over_shortest_edge
                .max(other.circumradius_over_shortest_edge),
        }
    }
}

/// Lengths of the six edges of a tetrahedron.
pub(crate) fn edge_lengths(x: &[Vector3<f64>; 4]) -> impl Iterator<Item = f64> {
    (0..4).flat_map(move |i| (i + 1..4).map(move |j| (x[i] - x[j]).norm()))
}

/// Signed volume of a tetrahedron, m³.
pub fn signed_volume(x: &[Vector3<f64>; 4]) -> f64 {
    Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]).determinant() / 6.0
}

/// The three corners of each of a tetrahedron's faces; face i is opposite corner i.
pub const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_tetrahedron_is_perfect() {
        let x = [[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]].map(Vector3::from);
        let quality = Quality::of(&x);
        assert!((quality.radius_ratio - 1.0).abs() < 1e-15);
        let expected = 6f64.sqrt() / 4.0;
        assert!((quality.circumradius_over_shortest_edge - expected).abs() < 1e-15);
    }
}
