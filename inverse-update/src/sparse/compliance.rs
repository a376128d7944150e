//! What some loads feel of the inverse, without its columns.

use std::marker::PhantomData;

use faer::Mat;
use pulp::{Simd, WithSimd};

use super::factor::Factor;
use super::lower::Digits;
use super::pivot::by_rows;
use super::substitution::TOGETHER;
use crate::maintainer::Load;

/// D⁻¹ L⁻¹ of a few right-hand sides, by position.
struct Forward<'a, T, const M: usize> {
    factor: &'a Factor,
    /// Panels that they reach, the root's first.
    path: &'a [usize],
    x: &'a mut [f64],
    digits: PhantomData<T>,
}

impl<T: Digits, const M: usize> WithSimd for Forward<'_, T, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut local = Vec::new();
        for &panel in self.path.iter().rev() {
            self.factor.panels[panel].forward::<S, T, M, TOGETHER>(simd, self.x, &mut local);
        }
    }
}

impl Factor {
    /// G C Gᵀ = Zᵀ D Z with Z = D⁻¹ L⁻¹ Gᵀ, the loads the rows of G.
    ///
    /// Z is filled along the paths of the loads only, and nothing is carried back.
    /// Cost: half a solve per load, less off the paths, and O(rows on the paths · loads²).
    pub(crate) fn compliance(&self, loads: &[Load]) -> Mat<f64> {
        self.compliance_in::<f64>(loads)
    }

    /// The same with the digits of [`precondition`](Self::precondition).
    pub(crate) fn rough_compliance(&self, loads: &[Load]) -> Mat<f64> {
        match self.may_round {
            true => self.compliance_in::<f32>(loads),
            false => self.compliance_in::<f64>(loads),
        }
    }

    fn compliance_in<T: Digits>(&self, loads: &[Load]) -> Mat<f64> {
        let (m, k) = (self.block, loads.len());
        let position = |row: usize| self.position_of[row / m];
        let path = self.path(loads.iter().flatten().map(|load| position(load.0)));
        let columns = path.iter().flat_map(|&panel| {
            let panel = &self.panels[panel];
            (0..panel.width).map(move |column| (panel, column))
        });
        let columns: Vec<_> = columns.collect();
        let mut z = Mat::<f64>::zeros(m * columns.len(), k);
        let mut dz = z.clone();
        let length = m * self.positions();
        let mut x = vec![0.0; TOGETHER * length];
        let arch = pulp::Arch::new();
        for (group, loads) in loads.chunks(TOGETHER).enumerate() {
            for (side, load) in loads.iter().enumerate() {
                for &(row, force) in load {
                    x[length * side + m * position(row) as usize + row % m] += force;
                }
            }
            let (x, path, digits) = (&mut x[..], &path[..], PhantomData::<T>);
            by_rows!(m, M => arch.dispatch(Forward::<T, M> { factor: self, path, x, digits }));
            for (i, &(panel, column)) in columns.iter().enumerate() {
                let first = m * panel.position(column);
                let d = &panel.diagonal[m * m * column..m * m * (column + 1)];
                for side in 0..loads.len() {
                    let j = TOGETHER * group + side;
                    let rows = &mut x[length * side + first..][..m];
                    for a in 0..m {
                        z[(m * i + a, j)] = rows[a];
                        dz[(m * i + a, j)] = (0..m).map(|b| d[m * a + b] * rows[b]).sum();
                    }
                    rows.fill(0.0);
                }
            }
        }
        let block = z.transpose() * &dz;
        Mat::from_fn(k, k, |i, j| 0.5 * (block[(i, j)] + block[(j, i)]))
    }
}
