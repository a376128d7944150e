//! Loads that follow the body: pressures on pieces of surface that turn and grow with it.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::element::Element;
use crate::field::Field;

/// The loads on the corners of one element, f_i = cof(F) a_i, F its deformation gradient: the area vectors
/// of what it carries are cof(F) times those at rest (Nanson).
///
/// They have no potential in general, and their derivative ∂f_i/∂x_j = −(F (a_i × ∇λ_j))× is not symmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following {
    vertices: [usize; 4],
    gradients: [Vector3<f64>; 4],
    at_rest: [Vector3<f64>; 4],
}

impl Following {
    /// Those of `element` that at rest would be `at_rest`, N: of a pressure p on pieces of areas A that its
    /// corners carry by weights w, −p Σ w A.
    pub fn new(element: &Element, at_rest: [Vector3<f64>; 4]) -> Self {
        let Element { vertices, geometry, .. } = *element;
        Self { vertices, gradients: geometry.gradients, at_rest }
    }

    /// The element's corners, vertex numbers.
    pub(super) fn vertices(&self) -> [usize; 4] {
        self.vertices
    }

    /// F.
    fn gradient(&self, positions: &Field) -> Matrix3<f64> {
        let corners = self.vertices.iter().zip(&self.gradients);
        corners.map(|(&v, gradient)| positions[v] * gradient.transpose()).sum()
    }

    /// Adds the forces at `positions` to `loads`, N by vertex number.
    pub fn add_forces(&self, positions: &Field, loads: &mut Field) {
        let f = self.gradient(positions);
        let [a, b, c] = [0, 1, 2].map(|i| f.column(i).into_owned());
        let cofactor = Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)]);
        for (&v, at_rest) in self.vertices.iter().zip(&self.at_rest) {
            loads[v] += cofactor * at_rest;
        }
    }

    /// −∂f/∂x at `positions`, N/m, by corners and axes: what they add to the stiffness.
    pub fn stiffness(&self, positions: &Field) -> SMatrix<f64, 12, 12> {
        let f = self.gradient(positions);
        let mut stiffness = SMatrix::<f64, 12, 12>::zeros();
        for (i, at_rest) in self.at_rest.iter().enumerate() {
            for (j, gradient) in self.gradients.iter().enumerate() {
                let block = (f * at_rest.cross(gradient)).cross_matrix();
                stiffness.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
            }
        }
        stiffness
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;

    /// On a quadratic map central differences are exact but for rounding, ε/h of the forces.
    #[test]
    fn the_stiffness_is_the_derivative_of_the_forces() {
        let (body, rest) = Body::new().of_one(nalgebra::Matrix6::identity());
        let at_rest = [[0.1, -0.4, 0.2], [0.3, 0.2, -0.5], [0.0; 3], [-0.2, 0.7, 0.1]];
        let following = Following::new(&body.elements()[0], at_rest.map(Vector3::from));
        let start = rest.map(|x| x + 0.3 * x.component_mul(&x.yzx()) - 0.2 * x.zxy());
        let forces = |x: &[Vector3<f64>; 4]| {
            let mut loads = [Vector3::zeros(); 4];
            following.add_forces(x, &mut loads);
            loads
        };
        let (stiffness, h) = (following.stiffness(&start), 1e-3);
        for j in 0..12 {
            let [mut more, mut less] = [start; 2];
            more[j / 3][j % 3] += h;
            less[j / 3][j % 3] -= h;
            let (more, less) = (forces(&more), forces(&less));
            for i in 0..12 {
                let slope = (more[i / 3][i % 3] - less[i / 3][i % 3]) / (2.0 * h);
                assert!((stiffness[(i, j)] + slope).abs() < 1e-12, "{i} {j}: {slope}");
            }
        }
        assert!((stiffness - stiffness.transpose()).amax() > 0.1, "it is not symmetric");
        // cof F = det(F) F⁻ᵀ.
        let f = following.gradient(&start);
        let cofactor = f.try_inverse().unwrap().transpose() * f.determinant();
        let loads = forces(&start);
        (0..4).for_each(|i| {
            assert!((loads[i] - cofactor * Vector3::from(at_rest[i])).norm() < 1e-14);
        });
    }
}
