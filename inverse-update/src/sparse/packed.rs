//! A panel's L once more, in the order in which substitution reads it, and the kernels that do.
//!
//! Columns go in strips of up to [`WIDE`] block columns. Of a strip there are the rows of its own
//! columns, a small triangle, and below it chunks of [`CHUNK`] scalar rows, each column by column.
//! So a pass reads memory from its beginning to its end, keeps sums of a chunk's rows (forward) or
//! of a strip's columns (backward) in registers, and loads and stores a right-hand side once per
//! strip, not once per column.
//!
//! A copy is made at the first use after a change: one pass over the panel, and its memory again. In
//! [f32](Digits) it takes half of that, and half of the time to read; arithmetic is in f64 all the same.

use pulp::Simd;

use super::factor::Panel;
use super::lower::{CHUNK, Digits, Packed};
use super::pivot::Pivot;

/// Block columns of a strip, at most.
const WIDE: usize = 4;

/// A strip of K block columns of M rows.
#[derive(Clone, Copy)]
struct Strip<'a, T: Digits, const M: usize, const K: usize> {
    /// The row of the panel that its own rows begin with.
    first: usize,
    /// By column and row, in blocks.
    triangle: &'a [[[f64; M]; K]],
    /// By chunk, block column and column.
    below: &'a [[[T::Rows; M]; K]],
}

/// Runs a kernel with the block columns of a strip, [`WIDE`] of `$count` at most, as the constant
/// `$K`.
macro_rules! strip {
    ($count:expr, $K:ident => $kernel:expr) => {{
        macro_rules! with {
            ($constant:literal) => {{
                const $K: usize = $constant;
                $kernel
            }};
        }
        match $count {
            1 => with!(1),
            2 => with!(2),
            3 => with!(3),
            _ => with!(4),
        }
    }};
}

/// Chunks of the rows below a strip that ends with block column `end`.
fn chunks(height: usize, end: usize) -> usize {
    (height - end).div_ceil(CHUNK)
}

impl Panel {
    /// Scalar rows.
    fn height<const M: usize>(&self) -> usize {
        M * (self.width + self.rows.len())
    }

    /// Room for a right-hand side on the rows of the panel and the zeros behind them.
    fn room<const M: usize>(&self) -> usize {
        self.height::<M>() + CHUNK
    }

    fn packed<T: Digits, const M: usize>(&self) -> &Packed<T> {
        T::copy_in(&self.values).get_or_init(|| self.pack::<T, M>())
    }

    fn pack<T: Digits, const M: usize>(&self) -> Packed<T> {
        let height = self.height::<M>();
        let mut packed = Packed { triangles: Vec::new(), below: Vec::new() };
        let ends = |first: usize| (first + WIDE).min(self.width);
        let count = |first: usize| M * (ends(first) - first) * chunks(height, M * ends(first));
        packed.below.reserve_exact((0..self.width).step_by(WIDE).map(count).sum());
        for first in (0..self.width).step_by(WIDE) {
            let end = ends(first);
            let columns = &self.values[self.stride * M * first..self.stride * M * end];
            for column in columns.chunks_exact(self.stride) {
                packed.triangles.extend_from_slice(&column[M * first..M * end]);
            }
            for chunk in 0..chunks(height, M * end) {
                let from = M * end + CHUNK * chunk;
                for column in columns.chunks_exact(self.stride) {
                    let rows = column[from..].first_chunk().copied();
                    packed.below.push(T::rows(rows.unwrap_or_default()));
                }
            }
        }
        packed
    }

    /// The strip from block column `first` on. It begins at `at` in both parts, which moves behind it.
    #[inline(always)]
    fn strip<'a, T: Digits, const M: usize, const K: usize>(
        &self,
        packed: &'a Packed<T>,
        first: usize,
        at: &mut (usize, usize),
    ) -> Strip<'a, T, M, K> {
        let size = M * K * M * K;
        let count = M * K * chunks(self.height::<M>(), M * (first + K));
        let triangle = &packed.triangles[at.0..at.0 + size];
        let below = &packed.below[at.1..at.1 + count];
        *at = (at.0 + size, at.1 + count);
        Strip {
            first: M * first,
            triangle: triangle.as_chunks::<M>().0.as_chunks::<K>().0,
            below: below.as_chunks::<M>().0.as_chunks::<K>().0,
        }
    }

    /// x ← L⁻¹ x, then the panel's own rows of D⁻¹ x, for R right-hand sides one after the other.
    #[inline(always)]
    pub(super) fn forward<S: Simd, T: Digits, const M: usize, const R: usize>(
        &self,
        simd: S,
        x: &mut [f64],
        local: &mut Vec<f64>,
    ) {
        let length = x.len() / R;
        let own = M * self.low..M * (self.low + self.width);
        let is_zero = |x: &[f64]| x[own.clone()].iter().all(|&value| value == 0.0);
        if x.chunks_exact(length).all(is_zero) {
            return;
        }
        let room = self.room::<M>();
        local.clear();
        local.resize(R * room, 0.0);
        for (x, local) in x.chunks_exact(length).zip(local.chunks_exact_mut(room)) {
            let own = x[own.clone()].as_chunks::<M>().0;
            for (to, from) in local.as_chunks_mut::<M>().0.iter_mut().zip(own.iter().rev()) {
                *to = *from;
            }
        }
        let (packed, mut at) = (self.packed::<T, M>(), (0, 0));
        for first in (0..self.width).step_by(WIDE) {
            strip!(self.width - first, K => {
                let strip = self.strip::<T, M, K>(packed, first, &mut at);
                strip.forward::<S, R>(simd, local, room);
            });
        }
        for (x, local) in x.chunks_exact_mut(length).zip(local.chunks_exact(room)) {
            let (heads, below) = local.split_at(M * self.width);
            let own = x[own.clone()].as_chunks_mut::<M>().0.iter_mut().rev();
            let pivots = self.pivots.chunks_exact(M * M);
            for ((own, head), pivot) in own.zip(heads.as_chunks::<M>().0).zip(pivots) {
                *own = *head;
                Pivot::<M>::read(pivot).solve(own);
            }
            let x = x.as_chunks_mut::<M>().0;
            for (&row, more) in self.rows.iter().zip(below.as_chunks::<M>().0) {
                for a in 0..M {
                    x[row as usize][a] += more[a];
                }
            }
        }
    }

    /// The panel's own rows of x ← L⁻ᵀ x, for one right-hand side.
    #[inline(always)]
    pub(super) fn backward<S: Simd, T: Digits, const M: usize>(
        &self,
        simd: S,
        x: &mut [f64],
        local: &mut Vec<f64>,
    ) {
        let x = x.as_chunks_mut::<M>().0;
        local.clear();
        let own = &x[self.low..self.low + self.width];
        own.iter().rev().for_each(|block| local.extend_from_slice(block));
        self.rows.iter().for_each(|&row| local.extend_from_slice(&x[row as usize]));
        local.resize(self.room::<M>(), 0.0);
        let packed = self.packed::<T, M>();
        let mut at = (packed.triangles.len(), packed.below.len());
        for first in (0..self.width).step_by(WIDE).rev() {
            strip!(self.width - first, K => {
                at.0 -= M * K * M * K;
                at.1 -= M * K * chunks(self.height::<M>(), M * (first + K));
                let strip = self.strip::<T, M, K>(packed, first, &mut at.clone());
                strip.backward(simd, local);
            });
        }
        let own = x[self.low..self.low + self.width].iter_mut().rev();
        own.zip(local.as_chunks::<M>().0).for_each(|(own, head)| *own = *head);
    }
}

impl<T: Digits, const M: usize, const K: usize> Strip<'_, T, M, K> {
    /// Its own rows of x ← L⁻¹ x, and what they change below.
    #[inline(always)]
    fn forward<S: Simd, const R: usize>(self, simd: S, local: &mut [f64], room: usize) {
        let mut heads = [[[0.0; M]; K]; R];
        for (head, local) in heads.iter_mut().zip(local.chunks_exact_mut(room)) {
            let own = &mut local[self.first..self.first + M * K];
            head.as_flattened_mut().copy_from_slice(own);
            for column in 0..K {
                for b in 0..M {
                    let factor = head[column][b];
                    let lower = &self.triangle[M * column + b];
                    for row in column + 1..K {
                        for a in 0..M {
                            head[row][a] -= lower[row][a] * factor;
                        }
                    }
                }
            }
            own.copy_from_slice(head.as_flattened());
        }
        let mut locals = local.chunks_exact_mut(room);
        let targets: [&mut [[f64; CHUNK]]; R] = std::array::from_fn(|_| match locals.next() {
            Some(local) => local[self.first + M * K..].as_chunks_mut().0,
            None => &mut [],
        });
        for (at, chunk) in self.below.iter().enumerate() {
            for part in 0..CHUNK / S::F64_LANES {
                let mut sums = [simd.splat_f64s(0.0); R];
                for r in 0..R {
                    sums[r] = S::as_simd_f64s(&targets[r][at]).0[part];
                }
                for column in 0..K {
                    for b in 0..M {
                        let lower = T::load(simd, &chunk[column][b], part);
                        for r in 0..R {
                            let head = simd.splat_f64s(-heads[r][column][b]);
                            sums[r] = simd.mul_add_e_f64s(lower, head, sums[r]);
                        }
                    }
                }
                for r in 0..R {
                    S::as_mut_simd_f64s(&mut targets[r][at]).0[part] = sums[r];
                }
            }
        }
    }

    /// Its own rows of x ← L⁻ᵀ x.
    #[inline(always)]
    fn backward<S: Simd>(self, simd: S, local: &mut [f64]) {
        let (own, below) = local[self.first..].split_at_mut(M * K);
        let mut sums = [[simd.splat_f64s(0.0); M]; K];
        for (chunk, x) in self.below.iter().zip(below.as_chunks::<CHUNK>().0) {
            for part in 0..CHUNK / S::F64_LANES {
                let x = S::as_simd_f64s(x).0[part];
                for column in 0..K {
                    for b in 0..M {
                        let lower = T::load(simd, &chunk[column][b], part);
                        sums[column][b] = simd.mul_add_e_f64s(lower, x, sums[column][b]);
                    }
                }
            }
        }
        let own = own.as_chunks_mut::<M>().0;
        for column in (0..K).rev() {
            for b in 0..M {
                let mut sum = simd.reduce_sum_f64s(sums[column][b]);
                for row in column + 1..K {
                    for a in 0..M {
                        sum += self.triangle[M * column + b][row][a] * own[row][a];
                    }
                }
                own[column][b] -= sum;
            }
        }
    }
}
