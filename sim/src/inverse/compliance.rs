//! The compliance of the body at some of its vertices.

use faer::Mat;
use faer::linalg::solvers::{Llt, Solve};

use super::link::InverseLink;
use crate::error::SimError;

impl InverseLink {
    /// C_pp of the displacements of `vertices` with those of `held` fixed, C_pp − C_ph C_hh⁻¹ C_hp:
    /// x, y, z of each vertex, by rows, m/N. Pressures stay free.
    ///
    /// All vertices are by number and have displacements that are not fixed. Cost: one block of the
    /// maintainer ([`compliance`](yawara_inverse_update::InverseMaintainer::compliance)) on both.
    /// # Errors
    /// [`SimError::Inverse`]; [`SimError::ComplianceNotPositive`] if the inverse is damaged.
    pub(crate) fn compliance_of(
        &self,
        vertices: &[usize],
        held: &[usize],
    ) -> Result<Vec<f64>, SimError> {
        let slots: Vec<usize> = vertices.iter().chain(held).filter_map(|&v| self.slot(v)).collect();
        let all = self.maintainer().compliance(&slots)?;
        let m = self.element().unknowns();
        let (n, h) = (3 * vertices.len(), 3 * held.len());
        let of = |i: usize| m * (i / 3) + i % 3;
        let mut block = Mat::from_fn(n, n, |i, j| all[(of(i), of(j))]);
        if h > 0 {
            let hh = Mat::from_fn(h, h, |i, j| all[(of(n + i), of(n + j))]);
            let hp = Mat::from_fn(h, n, |i, j| all[(of(n + i), of(j))]);
            let factor = Llt::new(hh.as_ref(), faer::Side::Lower)
                .map_err(|_| SimError::ComplianceNotPositive(held.len()))?;
            block -= hp.transpose() * factor.solve(&hp);
        }
        Ok((0..n * n).map(|at| block[(at / n, at % n)]).collect())
    }
}
