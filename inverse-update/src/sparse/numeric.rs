//! The factor of a matrix from scratch, panel by panel, with dense kernels.

use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::prelude::IntoConst;
use faer::{Accum, MatMut, MatRef, Par};

use super::factor::{Factor, NONE, Panel};
use super::panel_kernels::{PanelColumns, Scatter};
use super::pattern::Pattern;
use super::pivot::{BadPivot, by_rows};
use super::symbolic::Symbolic;

/// Columns of a panel that are eliminated before one product applies them to the rest of the panel.
const TOGETHER: usize = 16;

impl Factor {
    /// Factors a matrix in an order. Cost: the operations of the factorisation.
    /// # Errors
    /// [`BadPivot`] where a pivot has the wrong sign or is lost in rounding.
    pub(crate) fn new(pattern: &Pattern, symbolic: &Symbolic) -> Result<Self, BadPivot> {
        let mut factor = Self::zeros(pattern, symbolic);
        factor.assemble(pattern);
        by_rows!(pattern.block, M => factor.factor::<M>(pattern))?;
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
            may_round: false,
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

    /// Writes K where L and D will be; its diagonal blocks into the panels' values.
    fn assemble(&mut self, pattern: &Pattern) {
        let m = self.block;
        let mut index_of = vec![NONE; self.positions()];
        for panel in &mut self.panels {
            for (at, row) in panel.positions_from(0).enumerate() {
                index_of[row] = at as u32;
            }
            for column in 0..panel.width {
                let position = panel.position(column);
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
        // Products of a panel with itself, to be subtracted from the panels above.
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
    ) -> Result<Vec<f64>, BadPivot> {
        let (width, height) = (M * self.width, M * (self.width + self.rows.len()));
        let mut scaled = vec![0.0; height * width];
        let floors: Vec<[f64; M]> = (0..self.width)
            .map(|column| std::array::from_fn(|a| floor(self.position(column), a)))
            .collect();
        for strip in (0..self.width).step_by(TOGETHER) {
            let end = (strip + TOGETHER).min(self.width);
            let (scaled, floors) = (&mut scaled[..], &floors[..]);
            let kernel =
                PanelColumns::<M> { panel: self, first: strip, end, scaled, negative, floors };
            pulp::Arch::new().dispatch(kernel)?;
            if end == self.width {
                break;
            }
            // What these columns change in those behind them.
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
            let scaled = MatRef::from_column_major_slice(&*scaled, height, width);
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
        // The factorisation leaves values above the diagonal; kernels need zeros there.
        for column in 0..width {
            let zeros = M * (column / M + 1);
            self.values[self.stride * column..self.stride * column + zeros].fill(0.0);
        }
        Ok(scaled)
    }

    /// L (L D)ᵀ on the rows below the panel, lower half, column-major.
    fn square<const M: usize>(&self, scaled: &[f64], product: &mut [f64]) {
        let (own, rows) = (M * self.width, M * self.rows.len());
        let scaled = MatRef::from_column_major_slice(scaled, own + rows, own);
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

    /// Subtracts the product from the panels above; the rows are in elimination order here.
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
            pulp::Arch::new().dispatch(Scatter::<M> {
                product,
                rows,
                first,
                count,
                local: &local,
                target,
            });
            first += count;
        }
    }
}
