//! The factor of a matrix from scratch, panel by panel, with dense kernels.

use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::prelude::IntoConst;
use faer::{Accum, Mat, MatMut, MatRef, Par};

use super::factor::{Factor, NONE, Panel};
use super::pattern::Pattern;
use super::pivot::{BadPivot, Pivot};
use super::symbolic::Symbolic;

/// Columns of a panel factored before the rest of it is changed by them, in one product.
const STRIP: usize = 16;

impl Factor {
    /// Factors a matrix in an order. Cost: the operations of the factorisation.
    ///
    /// # Errors
    /// [`BadPivot`] where a pivot has the wrong sign or is lost in rounding.
    pub(crate) fn new(pattern: &Pattern, symbolic: &Symbolic) -> Result<Self, BadPivot> {
        let mut factor = Self::zeros(pattern, symbolic);
        factor.assemble(pattern);
        match pattern.block {
            1 => factor.factor::<1>(pattern)?,
            2 => factor.factor::<2>(pattern)?,
            3 => factor.factor::<3>(pattern)?,
            _ => factor.factor::<4>(pattern)?,
        }
        Ok(factor)
    }

    fn zeros(pattern: &Pattern, symbolic: &Symbolic) -> Self {
        let n = pattern.vertices();
        let position = |step: usize| (n - 1 - step) as u32;
        let mut factor = Self {
            block: pattern.block,
            negative: pattern.negative,
            panels: Vec::with_capacity(symbolic.panels.len()),
            panel_of: Vec::with_capacity(n),
            slot_of: symbolic.order.iter().rev().map(|&slot| slot as u32).collect(),
            position_of: vec![0; n],
            blocks: 0,
        };
        for (step, &slot) in symbolic.order.iter().enumerate() {
            factor.position_of[slot] = position(step);
        }
        for shape in symbolic.panels.iter().rev() {
            let low = n - shape.first - shape.width;
            let rows = shape.rows.iter().map(|&step| position(step as usize)).collect();
            let panel = Panel::zeros(low, shape.width, rows, pattern.block);
            factor.panel_of.extend(std::iter::repeat_n(factor.panels.len() as u32, shape.width));
            factor.blocks += panel.blocks();
            factor.panels.push(panel);
        }
        factor
    }

    /// Puts K where L and D will be; the diagonal blocks into the panels' values for now.
    fn assemble(&mut self, pattern: &Pattern) {
        let m = self.block;
        let mut index_of = vec![NONE; self.positions()];
        for panel in &mut self.panels {
            let own = (panel.low..panel.low + panel.width).rev();
            for (at, row) in own.chain(panel.rows.iter().map(|&row| row as usize)).enumerate() {
                index_of[row] = at as u32;
            }
            for column in 0..panel.width {
                let position = panel.low + panel.width - 1 - column;
                let slot = self.slot_of[position] as usize;
                for &other in pattern.neighbours(slot) {
                    let row = self.position_of[other as usize] as usize;
                    if row > position {
                        continue;
                    }
                    let (value, transposed) = pattern.block_at(other as usize, slot);
                    let first = m * index_of[row] as usize;
                    for (e, &entry) in value.iter().enumerate() {
                        let (a, b) = if transposed { (e % m, e / m) } else { (e / m, e % m) };
                        panel.values[panel.stride * (m * column + b) + first + a] = entry;
                    }
                }
            }
        }
    }

    fn factor<const M: usize>(&mut self, pattern: &Pattern) -> Result<(), BadPivot> {
        let limit = (M * pattern.vertices()) as f64 * f64::EPSILON;
        let mut index_of = vec![NONE; self.positions()];
        // Products of a panel with itself, to be taken off the panels above.
        let mut product: Vec<f64> = Vec::new();
        for at in (0..self.panels.len()).rev() {
            let (above, own) = self.panels.split_at_mut(at);
            let panel = &mut own[0];
            let slot_of = &self.slot_of;
            let scaled = panel.factor::<M>(self.negative, |position, a| {
                limit * pattern.diagonal(slot_of[position] as usize, a)
            })?;
            let rows = M * panel.rows.len();
            if rows == 0 {
                continue;
            }
            if product.len() < rows * rows {
                product.resize(rows * rows, 0.0);
            }
            panel.square::<M>(&scaled, &mut product[..rows * rows]);
            panel.subtract::<M>(&product[..rows * rows], above, &self.panel_of, &mut index_of);
        }
        Ok(())
    }
}

impl Panel {
    /// L and D of the panel's own columns; returns (L D) on the rows below them.
    fn factor<const M: usize>(
        &mut self,
        negative: usize,
        floor: impl Fn(usize, usize) -> f64,
    ) -> Result<Mat<f64>, BadPivot> {
        let (width, height) = (M * self.width, M * (self.width + self.rows.len()));
        let mut scaled = Mat::<f64>::zeros(height, width);
        for strip in (0..self.width).step_by(STRIP) {
            let end = (strip + STRIP).min(self.width);
            for column in strip..end {
                self.eliminate::<M>(column, end, scaled.as_mut(), negative, &floor)?;
            }
            if end == self.width {
                break;
            }
            // The strip's change of the columns behind it.
            let (done, rest) = self.values.split_at_mut(self.stride * M * end);
            let lower = MatRef::from_column_major_slice_with_stride(
                &done[self.stride * M * strip..],
                self.stride,
                M * (end - strip),
                self.stride,
            );
            let target = MatMut::from_column_major_slice_with_stride_mut(
                rest,
                self.stride,
                width - M * end,
                self.stride,
            );
            let lower = lower.submatrix(M * end, 0, height - M * end, M * (end - strip));
            let scaled = scaled.submatrix(M * end, M * strip, width - M * end, M * (end - strip));
            faer::linalg::matmul::matmul(
                target.submatrix_mut(M * end, 0, height - M * end, width - M * end),
                Accum::Add,
                lower,
                scaled.transpose(),
                -1.0,
                Par::Seq,
            );
        }
        // Above the diagonal there is rubbish; kernels want zeros there.
        for column in 0..width {
            let zeros = M * (column / M + 1);
            self.values[self.stride * column..self.stride * column + zeros].fill(0.0);
        }
        Ok(scaled)
    }

    /// One block column, and what it changes up to column `end`.
    fn eliminate<const M: usize>(
        &mut self,
        column: usize,
        end: usize,
        mut scaled: MatMut<'_, f64>,
        negative: usize,
        floor: &impl Fn(usize, usize) -> f64,
    ) -> Result<(), BadPivot> {
        let (stride, height) = (self.stride, M * (self.width + self.rows.len()));
        let position = self.low + self.width - 1 - column;
        let at = |row: usize, c: usize| stride * c + row;
        let mut d = [[0.0; M]; M];
        for a in 0..M {
            for b in 0..=a {
                d[a][b] = self.values[at(M * column + a, M * column + b)];
                d[b][a] = d[a][b];
            }
        }
        let floors = std::array::from_fn(|a| floor(position, a));
        let pivot = Pivot::<M>::new(&d, &floors, negative).map_err(|(row, value)| BadPivot {
            position,
            row,
            value,
            limit: floors[row],
        })?;
        let own = M * M * column..M * M * (column + 1);
        self.diagonal[own.clone()].copy_from_slice(d.as_flattened());
        pivot.write(&mut self.pivots[own]);
        for row in M * (column + 1)..height {
            let mut x: [f64; M] = std::array::from_fn(|b| self.values[at(row, M * column + b)]);
            for b in 0..M {
                scaled[(row, M * column + b)] = x[b];
            }
            pivot.solve(&mut x);
            for b in 0..M {
                self.values[at(row, M * column + b)] = x[b];
            }
        }
        let (done, rest) = self.values.split_at_mut(stride * M * (column + 1));
        for later in M * (column + 1)..M * end {
            let target = &mut rest[stride * (later - M * (column + 1))..][later / M * M..height];
            for b in 0..M {
                let factor = scaled[(later, M * column + b)];
                let lower = &done[stride * (M * column + b)..][later / M * M..height];
                for (t, &l) in target.iter_mut().zip(lower) {
                    *t -= factor * l;
                }
            }
        }
        Ok(())
    }

    /// L (L D)ᵀ on the rows below the panel, lower half, column-major.
    fn square<const M: usize>(&self, scaled: &Mat<f64>, product: &mut [f64]) {
        let (own, rows) = (M * self.width, M * self.rows.len());
        let lower = MatRef::from_column_major_slice_with_stride(
            &self.values,
            self.stride,
            own,
            self.stride,
        );
        triangular::matmul(
            MatMut::from_column_major_slice_mut(product, rows, rows),
            BlockStructure::TriangularLower,
            Accum::Replace,
            lower.submatrix(own, 0, rows, own),
            BlockStructure::Rectangular,
            scaled.submatrix(own, 0, rows, own).transpose().into_const(),
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
    }

    /// Takes the product off the panels above; the rows are ordered here as they are eliminated.
    fn subtract<const M: usize>(
        &self,
        product: &[f64],
        above: &mut [Panel],
        panel_of: &[u32],
        index_of: &mut [u32],
    ) {
        let rows = M * self.rows.len();
        let mut first = 0;
        while first < self.rows.len() {
            let target = &mut above[panel_of[self.rows[first] as usize] as usize];
            for (at, &row) in target.rows.iter().enumerate() {
                index_of[row as usize] = (target.width + at) as u32;
            }
            let here = |row: u32| row as usize >= target.low;
            let count = self.rows[first..].iter().take_while(|&&row| here(row)).count();
            let local: Vec<usize> = self.rows[first..]
                .iter()
                .map(|&row| {
                    let at = row as usize;
                    if here(row) { target.local(at) } else { index_of[at] as usize }
                })
                .collect();
            for j in 0..count {
                for b in 0..M {
                    let from = &product[rows * (M * (first + j) + b)..][..rows];
                    let column = target.stride * (M * local[j] + b);
                    let to = &mut target.values[column..column + target.stride];
                    for i in j..local.len() {
                        for a in 0..M {
                            to[M * local[i] + a] -= from[M * (first + i) + a];
                        }
                    }
                }
            }
            first += count;
        }
    }
}
