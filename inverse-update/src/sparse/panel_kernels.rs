//! The kernels of a factorisation that are not matrix products, compiled for each vector unit.

use pulp::{Simd, WithSimd};

use super::factor::Panel;
use super::pivot::{BadPivot, Pivot};

/// The columns `first..end` of a panel, to be eliminated; all before them are.
pub(crate) struct PanelColumns<'a, const M: usize> {
    pub panel: &'a mut Panel,
    pub first: usize,
    pub end: usize,
    /// L D of the panel's columns, one scalar column of the panel's height after the other.
    pub scaled: &'a mut [f64],
    pub negative: usize,
    /// The least pivots by column and row.
    pub floors: &'a [[f64; M]],
}

impl<const M: usize> WithSimd for PanelColumns<'_, M> {
    type Output = Result<(), BadPivot>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Self::Output {
        for column in self.first..self.end {
            self.pivot(column)?;
            self.change_later(column);
        }
        Ok(())
    }
}

impl<const M: usize> PanelColumns<'_, M> {
    /// D of one block column, and L on the rows below.
    #[inline(always)]
    fn pivot(&mut self, column: usize) -> Result<(), BadPivot> {
        let panel = &mut *self.panel;
        let (stride, height) = (panel.stride, M * (panel.width + panel.rows.len()));
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
        let below = M * (column + 1)..height;
        let mut columns = panel.values[stride * M * column..].chunks_mut(stride);
        let lower: [&mut [f64]; M] = std::array::from_fn(|_| match columns.next() {
            Some(values) => &mut values[below.clone()],
            None => &mut [],
        });
        let mut columns = self.scaled[height * M * column..].chunks_exact_mut(height);
        for values in &lower {
            if let Some(scaled) = columns.next() {
                scaled[below.clone()].copy_from_slice(values);
            }
        }
        let count = below.len();
        let lower = lower.map(|values| &mut values[..count]);
        for row in 0..count {
            let mut x: [f64; M] = std::array::from_fn(|b| lower[b][row]);
            pivot.solve(&mut x);
            for b in 0..M {
                lower[b][row] = x[b];
            }
        }
        Ok(())
    }

    /// What one block column changes in those up to `end`.
    #[inline(always)]
    fn change_later(&mut self, column: usize) {
        let (stride, height) = (self.panel.stride, M * (self.panel.width + self.panel.rows.len()));
        let (done, rest) = self.panel.values.split_at_mut(stride * M * (column + 1));
        let done = &done[stride * M * column..];
        for (at, target) in rest.chunks_mut(stride).take(M * (self.end - column - 1)).enumerate() {
            let later = M * (column + 1) + at;
            let rows = later / M * M..height;
            let factors: [f64; M] =
                std::array::from_fn(|b| self.scaled[height * (M * column + b) + later]);
            let target = &mut target[rows.clone()];
            let lower: [&[f64]; M] =
                std::array::from_fn(|b| &done[stride * b..][rows.clone()][..target.len()]);
            for (row, t) in target.iter_mut().enumerate() {
                let mut sum = 0.0;
                for b in 0..M {
                    sum += factors[b] * lower[b][row];
                }
                *t -= sum;
            }
        }
    }
}

/// The panel's product with itself, subtracted from a panel above it.
pub(crate) struct Scatter<'a, const M: usize> {
    /// Lower half, column-major, `rows` scalar rows.
    pub product: &'a [f64],
    pub rows: usize,
    /// The first block row that goes to this panel, and how many of its columns do.
    pub first: usize,
    pub count: usize,
    /// Where the block rows from the first on are in the panel.
    pub local: &'a [usize],
    pub target: &'a mut Panel,
}

impl<const M: usize> WithSimd for Scatter<'_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { product, rows, first, count, local, target } = self;
        for j in 0..count {
            for b in 0..M {
                let from = &product[rows * (M * (first + j) + b)..][..rows][M * (first + j)..];
                let column = target.stride * (M * local[j] + b);
                let to = &mut target.values[column..column + target.stride];
                for (from, &at) in from.as_chunks::<M>().0.iter().zip(&local[j..]) {
                    let to = &mut to[M * at..M * at + M];
                    for a in 0..M {
                        to[a] -= from[a];
                    }
                }
            }
        }
    }
}
