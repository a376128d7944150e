//! Mass of a linear tetrahedron, and what a bisection does to it.

use faer::Mat;
use nalgebra::{Matrix1, Matrix4, SMatrix, Vector4};

use crate::hand_over::{Halved, RingPart};

/// How the mass of a tetrahedron is laid on its corners.
///
/// Both give a uniform velocity v the momentum ρVv, so that they do not differ in what a body
/// weighs or how its centre of mass moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mass {
    /// ∫ρ λ_i λ_j = (ρV/20)(1 + δ_ij): a bisection of even density leaves it as it is.
    #[default]
    Consistent,
    /// (ρV/4) δ_ij: diagonal, three columns more in the change that a split makes.
    Lumped,
}

impl Mass {
    /// The 4×4 matrix of the corners, kg, of a tetrahedron of `mass_kg`; the same for each axis.
    pub fn matrix(self, mass_kg: f64) -> Matrix4<f64> {
        match self {
            Self::Consistent => (Matrix4::identity() + Matrix4::repeat(1.0)) * (mass_kg / 20.0),
            Self::Lumped => Matrix4::identity() * (0.25 * mass_kg),
        }
    }

    /// Adds `factor` (1/s²) times the mass to a parent's share of a ring.
    pub(super) fn add_to(self, part: &mut RingPart, halved: &Halved, factor: f64) {
        let half_volume = 0.5 * halved.geometry.volume;
        let parent = self.matrix(halved.density.iter().sum::<f64>() * half_volume);
        add_block(&mut part.parent, &parent, factor);
        for (half, density) in halved.density.into_iter().enumerate() {
            let mass = self.matrix(density * half_volume);
            // The parent's corners and d → the half's: its midpoint replaces the other end.
            let (kept, replaced) = if half == 0 { (0, halved.end) } else { (halved.end, 0) };
            let mut straight = Matrix4::identity();
            straight[(replaced, replaced)] = 0.5;
            straight[(replaced, kept)] = 0.5;
            let onto = mass.column(replaced);
            add_block(&mut part.straight, &(straight.transpose() * mass * straight), factor);
            add_block(&mut part.coupling, &(straight.transpose() * onto), factor);
            add_block(&mut part.own, &Matrix1::new(onto[replaced]), factor);
        }
        for (lean, y) in part.lean.iter_mut().zip(self.excess(halved).iter()) {
            *lean += factor * y;
        }
    }

    /// y with uᵀ(M_halves − M_parent)u = 2 (u_a − u_b) yᵀu for d = 0, a corner 0 and b the other
    /// end, kg.
    ///
    /// With ½(ρ₁−ρ₂) = δ: `consistent` (δV/40)(3/2, 3/2, 1, 1) on (a, b, c, d), because the density
    /// leans to one end; `lumped` ½(−ρV/16 (e_a−e_b) + δV/8 (e_a+e_b)), because the ends give mass
    /// to the midpoint.
    fn excess(self, halved: &Halved) -> Vector4<f64> {
        let volume = halved.geometry.volume;
        let [first, second] = halved.density;
        let leaning = 0.5 * (first - second) * volume;
        match self {
            Self::Consistent => {
                let mut y = Vector4::repeat(leaning / 40.0);
                y[0] *= 1.5;
                y[halved.end] *= 1.5;
                y
            }
            Self::Lumped => {
                let given = 0.5 * (first + second) * volume / 32.0;
                let mut y = Vector4::zeros();
                y[0] = leaning / 16.0 - given;
                y[halved.end] = leaning / 16.0 + given;
                y
            }
        }
    }
}

/// Adds `factor` · `block` ⊗ I₃ to the displacements of a matrix with more unknowns per vertex.
pub(super) fn add_block<const R: usize, const C: usize>(
    matrix: &mut Mat<f64>,
    block: &SMatrix<f64, R, C>,
    factor: f64,
) {
    let (rows, columns) = (matrix.nrows() / R, matrix.ncols() / C);
    for (i, j) in (0..R).flat_map(|i| (0..C).map(move |j| (i, j))) {
        for axis in 0..3 {
            matrix[(rows * i + axis, columns * j + axis)] += factor * block[(i, j)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_weigh_the_same() {
        for mass in [Mass::Consistent, Mass::Lumped] {
            let m = mass.matrix(3.0);
            assert!((m.sum() - 3.0).abs() < 1e-15);
            (0..4).for_each(|i| assert!((m.row(i).sum() - 0.75).abs() < 1e-15));
            assert!(m.cholesky().is_some());
        }
    }

    #[test]
    fn the_consistent_mass_is_that_of_the_field() {
        // ∫λ_iλ_j over the unit simplex by the midpoints of the edges and corners: exact to
        // degree 2 with weights −1/20 (corners) and 1/5 (edges) of the volume.
        let edges = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
        let mut exact = Matrix4::<f64>::identity() * (-1.0 / 20.0);
        for (i, j) in edges {
            for (a, b) in [(i, i), (j, j), (i, j), (j, i)] {
                exact[(a, b)] += 0.2 * 0.25;
            }
        }
        assert!((Mass::Consistent.matrix(1.0) - exact).amax() < 1e-16);
    }
}
