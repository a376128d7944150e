//! The linear tetrahedron: gradients, strains, stiffness.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

/// Strain in Voigt order xx yy zz xy yz zx, engineering shear.
pub type Strain = Vector6<f64>;

/// voigt(sym(d ⊗ g)) as a matrix acting on d: the strain of the displacement d·λ with ∇λ = g.
///
/// Shape 6×3. Units: those of g, 1/m.
pub fn strain_operator(g: &Vector3<f64>) -> SMatrix<f64, 6, 3> {
    let (x, y, z) = (g.x, g.y, g.z);
    #[rustfmt::skip]
    let rows = [
        x,   0.0, 0.0,
        0.0, y,   0.0,
        0.0, 0.0, z,
        y,   x,   0.0,
        0.0, z,   y,
        z,   0.0, x,
    ];
    SMatrix::from_row_slice(&rows)
}

/// Voigt strain of a displacement gradient ∂u_i/∂X_j.
pub fn strain_from_gradient(gradient: &Matrix3<f64>) -> Strain {
    let g = gradient;
    Vector6::new(g.m11, g.m22, g.m33, g.m12 + g.m21, g.m23 + g.m32, g.m13 + g.m31)
}

/// Rest geometry of a tetrahedron with linear shape functions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearTet {
    /// ∇λ_i of the four barycentric coordinates, 1/m.
    pub gradients: [Vector3<f64>; 4],
    /// Volume, m³, positive whatever the corners' orientation.
    pub volume: f64,
}

impl LinearTet {
    /// Geometry of four corners (m). Flat tetrahedra give non-finite gradients.
    pub fn new(corners: &[Vector3<f64>; 4]) -> Self {
        let e = [corners[1] - corners[0], corners[2] - corners[0], corners[3] - corners[0]];
        let volume6 = e[0].cross(&e[1]).dot(&e[2]);
        let g1 = e[1].cross(&e[2]) / volume6;
        let g2 = e[2].cross(&e[0]) / volume6;
        let g3 = e[0].cross(&e[1]) / volume6;
        Self { gradients: [-(g1 + g2 + g3), g1, g2, g3], volume: volume6.abs() / 6.0 }
    }

    /// Σ x_i ⊗ ∇λ_i: the deformation gradient if x are positions, the displacement gradient if
    /// x are displacements.
    pub fn gradient(&self, x: &[Vector3<f64>; 4]) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        for (x, g) in x.iter().zip(&self.gradients) {
            sum += x * g.transpose();
        }
        sum
    }

    /// The strain-displacement matrix B, 6×12, 1/m.
    pub fn strain_matrix(&self) -> SMatrix<f64, 6, 12> {
        let mut b = SMatrix::<f64, 6, 12>::zeros();
        for (i, g) in self.gradients.iter().enumerate() {
            b.fixed_view_mut::<6, 3>(0, 3 * i).copy_from(&strain_operator(g));
        }
        b
    }

    /// The element stiffness K = V BᵀDB, 12×12, N/m: symmetric to the last bit. (In a D that is
    /// stiff in one direction the rounding of mirrored entries is that of the stiff ones.)
    pub fn stiffness(&self, elasticity: &Matrix6<f64>) -> SMatrix<f64, 12, 12> {
        let b = self.strain_matrix();
        let k = b.transpose() * elasticity * b;
        (k + k.transpose()) * (0.5 * self.volume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stiffness_of_a_brittle_direction_is_symmetric_to_the_last_bit() {
        let corners = [[0.0, 0.0, 0.0], [0.9, 0.1, 0.2], [0.3, 1.1, 0.1], [0.2, 0.4, 0.7]];
        let tet = LinearTet::new(&corners.map(Vector3::from));
        let along = Matrix6::from_fn(|i, j| 1e9 * 0.7_f64.powi((i + j) as i32));
        let k = tet.stiffness(&(along + Matrix6::identity()));
        assert_eq!(k, k.transpose());
        let b = tet.strain_matrix();
        let energy =
            |u: &SMatrix<f64, 12, 1>| (b * u).dot(&((along + Matrix6::identity()) * b * u));
        let u = SMatrix::<f64, 12, 1>::from_fn(|i, _| (i as f64).sin());
        let error = (u.dot(&(k * u)) - tet.volume * energy(&u)).abs();
        assert!(error <= 1e-12 * k.norm(), "{error:e}");
    }
}
