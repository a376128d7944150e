//! The kernel of a walk: all columns of one panel, compiled for each vector unit.

use pulp::{Simd, WithSimd};

use super::factor::{NONE, Panel};
use super::lower::CHUNK;
use super::pivot::{BadPivot, Pivot, square};
use crate::change::PIVOT_FLOOR;

/// w and Θ of some columns of U. w is stored in chunks of [`CHUNK`] scalar rows, each column by
/// column.
#[derive(Debug, Default)]
pub(crate) struct SignGroup {
    pub from: Vec<f64>,
    pub to: Vec<f64>,
    pub core: Core,
}

/// Θ and intermediate results, all padded to `padded` columns.
#[derive(Debug, Default)]
pub(crate) struct Core {
    pub rank: usize,
    padded: usize,
    theta: Vec<f64>,
    /// w_j, one scalar row after the other.
    head: Vec<f64>,
    /// w_j Θ, the same.
    product: Vec<f64>,
    /// w_j and G, column by column: M numbers each.
    head_by_column: Vec<f64>,
    gain_by_column: Vec<f64>,
}

impl SignGroup {
    /// Moves w_j out of w; false if it is 0.
    #[inline(always)]
    fn take_head<const M: usize>(&mut self, row: usize) -> bool {
        let (rank, padded) = (self.core.rank, self.core.padded);
        let mut any = false;
        for a in 0..M {
            let at = place(M * row + a, rank);
            for q in 0..rank {
                let value = std::mem::take(&mut self.to[at + CHUNK * q]);
                any |= value != 0.0;
                self.core.head[padded * a + q] = value;
                self.core.head_by_column[M * q + a] = value;
            }
        }
        any
    }

    /// Moves rows from where the last panel had them.
    pub(crate) fn enter<const M: usize>(&mut self, source: &[u32]) {
        let rank = self.core.rank;
        self.to.clear();
        self.to.resize((M * source.len()).next_multiple_of(CHUNK) * rank, 0.0);
        for (at, &source) in source.iter().enumerate() {
            if source == NONE {
                continue;
            }
            for a in 0..M {
                let from = place(M * source as usize + a, rank);
                let to = place(M * at + a, rank);
                let from = self.from[from..].iter().step_by(CHUNK).take(rank);
                let to = self.to[to..].iter_mut().step_by(CHUNK).take(rank);
                to.zip(from).for_each(|(to, &from)| *to = from);
            }
        }
    }
}

/// Where a scalar row of w starts.
#[inline(always)]
pub(crate) fn place(row: usize, rank: usize) -> usize {
    row / CHUNK * CHUNK * rank + row % CHUNK
}

impl Core {
    pub(crate) fn start(&mut self, signs: impl ExactSizeIterator<Item = f64>, block: usize) {
        self.rank = signs.len();
        self.padded = self.rank.next_multiple_of(CHUNK / 2);
        let n = self.padded;
        self.theta.clear();
        self.theta.resize(n * n, 0.0);
        for (q, sign) in signs.enumerate() {
            self.theta[(n + 1) * q] = sign;
        }
        for part in [&mut self.head, &mut self.product] {
            part.clear();
            part.resize(n * block, 0.0);
        }
        for part in [&mut self.head_by_column, &mut self.gain_by_column] {
            part.clear();
            part.resize(self.rank * block, 0.0);
        }
    }
}

/// All columns of a panel from `start` on.
pub(crate) struct Sweep<'a, const M: usize> {
    pub panel: &'a mut Panel,
    pub start: usize,
    pub negative: usize,
    pub groups: &'a mut [SignGroup],
    pub loss: &'a mut f64,
}

impl<const M: usize> WithSimd for Sweep<'_, M> {
    type Output = Result<(), BadPivot>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        // Vector units of 32 bytes and more multiply and add in one step; elsewhere that would be
        // a call of a function.
        if size_of::<S::f64s>() >= 32 { self.run::<true>() } else { self.run::<false>() }
    }
}

#[inline(always)]
pub(super) fn multiply_add<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

impl<const M: usize> Sweep<'_, M> {
    #[inline(always)]
    fn run<const FUSED: bool>(mut self) -> Result<(), BadPivot> {
        for column in self.start..self.panel.width {
            for group in 0..self.groups.len() {
                if self.groups[group].take_head::<M>(column - self.start) {
                    self.turn::<FUSED>(column, group)?;
                    self.rows::<FUSED>(column, group);
                }
            }
        }
        Ok(())
    }

    /// D' and its factors, G, and Θ for the columns to come.
    #[inline(always)]
    fn turn<const FUSED: bool>(&mut self, column: usize, group: usize) -> Result<(), BadPivot> {
        let core = &mut self.groups[group].core;
        let n = core.padded;
        core.product.fill(0.0);
        for (r, theta) in core.theta.chunks_exact(n).enumerate() {
            for a in 0..M {
                let factor = core.head[n * a + r];
                for (sum, &x) in core.product[n * a..n * (a + 1)].iter_mut().zip(theta) {
                    *sum = multiply_add::<FUSED>(factor, x, *sum);
                }
            }
        }
        let own = M * M * column..M * M * (column + 1);
        let old = Pivot::<M>::read(&self.panel.pivots[own.clone()]);
        let mut d: [[f64; M]; M] = square(&self.panel.diagonal[own.clone()]);
        let mut floor = [0.0; M];
        for a in 0..M {
            for b in 0..=a {
                let x = &core.product[n * a..n * (a + 1)];
                let y = &core.head[n * b..n * (b + 1)];
                let change = dot::<FUSED>(x, y);
                d[a][b] += change;
                d[b][a] = d[a][b];
                if a == b {
                    floor[a] = PIVOT_FLOOR * (1.0 / old.lower[a][a].abs() + change.abs());
                }
            }
        }
        let pivot = Pivot::new(&d, &floor, self.negative, self.panel.position(column))?;
        for a in 0..M {
            *self.loss = self.loss.max(floor[a] * pivot.lower[a][a].abs() / PIVOT_FLOOR);
        }
        self.panel.diagonal[own.clone()].copy_from_slice(d.as_flattened());
        pivot.write(&mut self.panel.pivots[own]);
        core.turn::<M, FUSED>(&pivot);
        Ok(())
    }

    /// w and L below a column.
    #[inline(always)]
    fn rows<const FUSED: bool>(&mut self, column: usize, group: usize) {
        let SignGroup { to: carried, core, .. } = &mut self.groups[group];
        let rank = core.rank;
        let first = M * (column + 1 - self.start) / CHUNK;
        let carried = &mut carried[first * CHUNK * rank..];
        let offset = M * self.start + first * CHUNK;
        let stride = self.panel.stride;
        let mut columns = self.panel.values[stride * M * column..stride * M * (column + 1)]
            .chunks_exact_mut(stride);
        let lower: [&mut [[f64; CHUNK]]; M] = std::array::from_fn(|_| {
            columns.next().map_or(&mut [][..], |c| c[offset..].as_chunks_mut::<CHUNK>().0)
        });
        let heads = core.head_by_column.as_chunks::<M>().0;
        let gains = core.gain_by_column.as_chunks::<M>().0;
        for (at, chunk) in carried.chunks_exact_mut(CHUNK * rank).enumerate() {
            let before: [[f64; CHUNK]; M] = std::array::from_fn(|a| lower[a][at]);
            let mut after = before;
            let chunk = chunk.as_chunks_mut::<CHUNK>().0;
            for ((w, head), gain) in chunk.iter_mut().zip(heads).zip(gains) {
                let mut x = *w;
                for a in 0..M {
                    for lane in 0..CHUNK {
                        x[lane] = multiply_add::<FUSED>(-head[a], before[a][lane], x[lane]);
                    }
                }
                *w = x;
                for a in 0..M {
                    for lane in 0..CHUNK {
                        after[a][lane] = multiply_add::<FUSED>(gain[a], x[lane], after[a][lane]);
                    }
                }
            }
            for a in 0..M {
                lower[a][at] = after[a];
            }
        }
    }
}

/// In four sums, so that additions don't wait for each other.
#[inline(always)]
fn dot<const FUSED: bool>(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; CHUNK / 2];
    for (x, y) in x.as_chunks::<{ CHUNK / 2 }>().0.iter().zip(y.as_chunks::<{ CHUNK / 2 }>().0) {
        for lane in 0..CHUNK / 2 {
            sums[lane] = multiply_add::<FUSED>(x[lane], y[lane], sums[lane]);
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

impl Core {
    /// G = (w_j Θ)ᵀ D'⁻¹ and Θ ← Θ − G w_j Θ, in the symmetric form Z Σ Zᵀ of the latter.
    #[inline(always)]
    fn turn<const M: usize, const FUSED: bool>(&mut self, pivot: &Pivot<M>) {
        let n = self.padded;
        // `head` is free now: there, half of G.
        self.head.copy_from_slice(&self.product);
        for i in 1..M {
            for k in 0..i {
                let (done, rest) = self.head.split_at_mut(n * i);
                for (x, &y) in rest[..n].iter_mut().zip(&done[n * k..n * (k + 1)]) {
                    *x = multiply_add::<FUSED>(-pivot.lower[i][k], y, *x);
                }
            }
        }
        let signs: [f64; M] = std::array::from_fn(|i| pivot.lower[i][i].signum());
        for i in 0..M {
            let root = pivot.lower[i][i].abs().sqrt();
            self.head[n * i..n * (i + 1)].iter_mut().for_each(|x| *x *= root);
        }
        for (r, theta) in self.theta.chunks_exact_mut(n).enumerate() {
            for i in 0..M {
                let factor = -signs[i] * self.head[n * i + r];
                for (x, &z) in theta.iter_mut().zip(&self.head[n * i..n * (i + 1)]) {
                    *x = multiply_add::<FUSED>(factor, z, *x);
                }
            }
        }
        for (q, gain) in self.gain_by_column.as_chunks_mut::<M>().0.iter_mut().enumerate() {
            let mut x: [f64; M] = std::array::from_fn(|a| self.product[n * a + q]);
            pivot.solve(&mut x);
            *gain = x;
        }
    }
}
