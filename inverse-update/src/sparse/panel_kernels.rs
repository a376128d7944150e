//! The kernels of a factorisation, compiled for each vector unit.

use pulp::{Simd, WithSimd};

use super::factor::Panel;
use super::pivot::{BadPivot, Pivot};

/// L D of a panel's columns: for every block row the columns one after the other, M numbers each.
pub(crate) struct Scaled<const M: usize> {
    pub values: Vec<[f64; M]>,
    /// Scalar columns of the panel.
    pub columns: usize,
}

impl<const M: usize> Scaled<M> {
    /// Those of scalar columns `first..end` in a block row.
    #[inline(always)]
    fn of_row(&self, row: usize, first: usize, end: usize) -> &[[f64; M]] {
        &self.values[self.columns * row + first..self.columns * row + end]
    }
}

/// The block columns `first..end` of a panel, to be eliminated; what those before them change in them is done.
pub(crate) struct PanelColumns<'a, const M: usize> {
    pub panel: &'a mut Panel,
    pub first: usize,
    pub end: usize,
    pub scaled: &'a mut Scaled<M>,
    pub negative: usize,
    /// The least pivots by column and row.
    pub floors: &'a [[f64; M]],
}

/// What block columns of a panel change in some columns of another one, or in its own later ones: those minus L (L D)ᵀ.
pub(crate) struct Subtract<'a, const M: usize> {
    /// L of the block columns `from..to`, and from one scalar column to the next.
    pub lower: &'a [f64],
    pub stride: usize,
    pub from: usize,
    pub to: usize,
    pub scaled: &'a Scaled<M>,
    /// The first block row that counts, and how many columns are changed: those of as many rows from the first on.
    pub first: usize,
    pub count: usize,
    /// Where the block rows from the first on are in the target.
    pub local: &'a [usize],
    /// Its columns from block column `offset` on, and from one scalar column to the next.
    pub target: &'a mut [f64],
    pub offset: usize,
    pub target_stride: usize,
}

/// Runs a kernel with as many vectors at once as there are registers for, rows enough for a block, and no more than there is
/// room for behind the last row of a panel: six blocks and a [chunk](super::lower::CHUNK) less one row.
macro_rules! by_unit {
    ($unit:ident, $kernel:expr, $simd:expr) => {
        match (size_of::<$unit::f64s>(), M) {
            (32, 4) => $kernel.run::<$unit, 2>($simd),
            (64.., 1 | 2) => $kernel.run::<$unit, 1>($simd),
            (32.., _) => $kernel.run::<$unit, 3>($simd),
            _ => $kernel.run::<$unit, 6>($simd),
        }
    };
}

impl<const M: usize> WithSimd for PanelColumns<'_, M> {
    type Output = Result<(), BadPivot>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        by_unit!(S, self, simd)
    }
}

impl<const M: usize> WithSimd for Subtract<'_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        by_unit!(S, self, simd)
    }
}

/// Rows that are handled at once, at most.
const MOST: usize = 24;

/// Σ over columns of the R vectors of their scalar rows from `row` on times M factors each.
#[inline(always)]
fn products<S: Simd, const M: usize, const R: usize>(
    simd: S,
    lower: &[f64],
    stride: usize,
    row: usize,
    factors: &[[f64; M]],
) -> [[f64; MOST]; M] {
    debug_assert!(row + rows_of::<S, R>(simd) <= stride, "row {row} of {stride} has no room");
    let mut sums = [[simd.splat_f64s(0.0); R]; M];
    for (column, factor) in lower.chunks_exact(stride).zip(factors) {
        let Some(rows) = S::as_simd_f64s(&column[row..]).0.first_chunk::<R>() else { break };
        for (sums, factor) in sums.iter_mut().zip(factor) {
            let factor = simd.splat_f64s(*factor);
            for (sum, rows) in sums.iter_mut().zip(rows) {
                *sum = simd.mul_add_e_f64s(factor, *rows, *sum);
            }
        }
    }
    let mut out = [[0.0; MOST]; M];
    for (out, sums) in out.iter_mut().zip(sums) {
        S::as_mut_simd_f64s(out).0[..R].copy_from_slice(&sums);
    }
    out
}

/// Scalar rows of R vectors.
#[inline(always)]
fn rows_of<S: Simd, const R: usize>(_: S) -> usize {
    R * size_of::<S::f64s>() / size_of::<f64>()
}

impl<const M: usize> PanelColumns<'_, M> {
    #[inline(always)]
    fn run<S: Simd, const R: usize>(mut self, simd: S) -> Result<(), BadPivot> {
        for column in self.first..self.end {
            self.catch_up::<S, R>(simd, column);
            self.pivot(column)?;
        }
        Ok(())
    }

    /// What the block columns from the first one on change in one.
    #[inline(always)]
    fn catch_up<S: Simd, const R: usize>(&mut self, simd: S, column: usize) {
        let (panel, first) = (&mut *self.panel, self.first);
        if column == first {
            return;
        }
        let (stride, height) = (panel.stride, M * (panel.width + panel.rows.len()));
        let (done, own) = panel.values.split_at_mut(stride * M * column);
        let done = &done[stride * M * first..];
        let factors = self.scaled.of_row(column, M * first, M * column);
        let together = rows_of::<S, R>(simd);
        for row in (M * column..height).step_by(together) {
            let sums = products::<S, M, R>(simd, done, stride, row, factors);
            for (values, sums) in own.chunks_exact_mut(stride).zip(&sums) {
                for (value, sum) in values[row..row + together].iter_mut().zip(sums) {
                    *value -= sum;
                }
            }
        }
    }

    /// D of one block column, and L and L D on the rows below.
    #[inline(always)]
    fn pivot(&mut self, column: usize) -> Result<(), BadPivot> {
        let panel = &mut *self.panel;
        let (stride, rows) = (panel.stride, panel.width + panel.rows.len());
        let mut d = [[0.0; M]; M];
        for a in 0..M {
            for b in 0..=a {
                d[a][b] = panel.values[stride * (M * column + b) + M * column + a];
                d[b][a] = d[a][b];
            }
        }
        let position = panel.position(column);
        let pivot = Pivot::<M>::new(&d, &self.floors[column], self.negative, position)?;
        let own = M * M * column..M * M * (column + 1);
        panel.diagonal[own.clone()].copy_from_slice(d.as_flattened());
        pivot.write(&mut panel.pivots[own]);
        let mut columns = panel.values[stride * M * column..].chunks_mut(stride);
        let lower: [&mut [[f64; M]]; M] = std::array::from_fn(|_| match columns.next() {
            Some(values) => &mut values.as_chunks_mut::<M>().0[..rows],
            None => &mut [],
        });
        let width = self.scaled.columns;
        let mut scaled = self.scaled.values.chunks_exact_mut(width).skip(column + 1);
        for row in column + 1..rows {
            let mut x: [[f64; M]; M] = std::array::from_fn(|b| lower[b][row]);
            if let Some(scaled) = scaled.next() {
                scaled[M * column..M * (column + 1)].copy_from_slice(&x);
            }
            pivot.solve_all(&mut x);
            for b in 0..M {
                lower[b][row] = x[b];
            }
        }
        Ok(())
    }
}

impl<const M: usize> Subtract<'_, M> {
    #[inline(always)]
    fn run<S: Simd, const R: usize>(self, simd: S) {
        let together = rows_of::<S, R>(simd);
        let Self { lower, stride, from, to, scaled, first, count, local, .. } = self;
        for j in 0..count {
            let factors = scaled.of_row(first + j, M * from, M * to);
            let column = self.target_stride * M * (local[j] - self.offset);
            let own = &mut self.target[column..column + self.target_stride * M];
            for i in (j..local.len()).step_by(together / M) {
                let sums = products::<S, M, R>(simd, lower, stride, M * (first + i), factors);
                for (own, sums) in own.chunks_exact_mut(self.target_stride).zip(&sums) {
                    let own = own.as_chunks_mut::<M>().0;
                    for (sums, &at) in sums[..together].as_chunks::<M>().0.iter().zip(&local[i..]) {
                        for a in 0..M {
                            own[at][a] -= sums[a];
                        }
                    }
                }
            }
        }
    }
}
