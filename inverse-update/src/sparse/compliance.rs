//! The block of the inverse at a tool, without its columns.

use faer::Mat;
use pulp::{Simd, WithSimd};

use super::factor::Factor;
use super::pivot::by_rows;
use super::substitution::TOGETHER;

/// D⁻¹ L⁻¹ of a few right-hand sides, by position.
struct Forward<'a, const M: usize> {
    factor: &'a Factor,
    x: &'a mut [[f64; TOGETHER]],
}

impl<const M: usize> WithSimd for Forward<'_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let mut local = Vec::new();
        for panel in (0..self.factor.panels.len()).rev() {
            self.factor.forward::<M, TOGETHER>(panel, self.x, &mut local);
        }
    }
}

impl Factor {
    /// C_pp = Eᵀ L⁻ᵀ D⁻¹ L⁻¹ E = Zᵀ D Z with Z = D⁻¹ L⁻¹ E, E the unit vectors of `slots`.
    ///
    /// Z is filled along the paths of the slots only, and nothing is carried back.
    /// Cost: half a solve per column, less off the paths, and O(rows on the paths · columns²).
    pub(crate) fn compliance(&self, slots: &[usize]) -> Mat<f64> {
        let m = self.block;
        let columns = m * slots.len();
        let mut z = Mat::<f64>::zeros(m * self.positions(), columns);
        let mut on_path = vec![false; self.positions()];
        let arch = pulp::Arch::new();
        for first in (0..columns).step_by(TOGETHER) {
            let mut x = vec![[0.0; TOGETHER]; m * self.positions()];
            for j in first..columns.min(first + TOGETHER) {
                let position = self.position_of[slots[j / m]] as usize;
                x[m * position + j % m][j - first] = 1.0;
            }
            by_rows!(m, M => arch.dispatch(Forward::<M> { factor: self, x: &mut x }));
            for (position, rows) in x.chunks_exact(m).enumerate() {
                if rows.as_flattened().iter().all(|&value| value == 0.0) {
                    continue;
                }
                on_path[position] = true;
                for (a, row) in rows.iter().enumerate() {
                    for j in first..columns.min(first + TOGETHER) {
                        z[(m * position + a, j)] = row[j - first];
                    }
                }
            }
        }
        let path: Vec<usize> = (0..self.positions()).filter(|&p| on_path[p]).collect();
        let z = Mat::from_fn(m * path.len(), columns, |i, j| z[(m * path[i / m] + i % m, j)]);
        let mut dz = Mat::<f64>::zeros(z.nrows(), columns);
        for (i, &position) in path.iter().enumerate() {
            let panel = &self.panels[self.panel_of[position] as usize];
            let own = m * m * panel.local(position);
            let d = &panel.diagonal[own..own + m * m];
            for j in 0..columns {
                for a in 0..m {
                    dz[(m * i + a, j)] = (0..m).map(|b| d[m * a + b] * z[(m * i + b, j)]).sum();
                }
            }
        }
        let block = z.transpose() * &dz;
        Mat::from_fn(columns, columns, |i, j| 0.5 * (block[(i, j)] + block[(j, i)]))
    }
}
