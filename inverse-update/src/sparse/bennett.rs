//! Low-rank changes of the factor: one walk down the elimination tree.
//!
//! K + U Σ Uᵀ has the factor that this recurrence makes of L and D, column by column, with w the
//! rows of U on what is left and Θ = Σ at the start (block Bennett):
//! - D' = D + w_j Θ w_jᵀ, G = Θ w_jᵀ D'⁻¹, Θ ← Θ − G w_j Θ,
//! - rows i below: w_i ← w_i − L_ij w_j, then L_ij ← L_ij + w_i G.
//!
//! Only columns that the change reaches are touched. Positive columns go first, with a Θ of their
//! own: with both signs at once G can be large where D' is not, a hyperbolic rotation near its pole,
//! which lost two digits more in a thousand updates. Quasi-definite matrices have no such choice.

use faer::MatRef;
use pulp::{Simd, WithSimd};

use super::factor::{Factor, LANES, NONE, Panel};
use super::pivot::{BadPivot, Pivot, square};
use crate::capacitance::PIVOT_FLOOR;

/// The most columns of a change that go together; more make several lanes.
const MOST: usize = 32;

/// What a walk carries along, kept from one to the next.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// Rows of w by position, as the last panel left them and as the next one has them.
    from: Vec<u32>,
    to: Vec<u32>,
    /// Index of a position in `from`, [`NONE`] elsewhere.
    index_of: Vec<u32>,
    /// Index in `from` of each row in `to`.
    source: Vec<u32>,
    /// Columns of one sign each; a column of the factor is changed by one lane after the other
    /// while it is in the cache, to the same end as by walks of their own.
    lanes: Vec<Lane>,
    /// The largest ratio of what a pivot was made of to the pivot, over all walks so far.
    pub loss: f64,
}

/// w in chunks of [`LANES`] scalar rows, in which it goes column by column, and Θ.
#[derive(Debug, Default)]
struct Lane {
    from: Vec<f64>,
    to: Vec<f64>,
    core: Core,
}

/// Θ and what the kernel makes of it, all padded to `padded` columns.
#[derive(Debug, Default)]
struct Core {
    rank: usize,
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

impl Factor {
    /// L D Lᵀ ← L D Lᵀ + U Σ Uᵀ with U on the rows of `positions` and Σ = diag(`signs`).
    ///
    /// Cost: (blocks of the columns on the path) · (columns of U) small products.
    /// # Errors
    /// [`BadPivot`] if a pivot has the wrong sign or has lost half of its digits; the factor is
    /// damaged then.
    pub(crate) fn update(
        &mut self,
        positions: &[u32],
        columns: MatRef<'_, f64>,
        signs: &[f64],
        scratch: &mut Scratch,
    ) -> Result<(), BadPivot> {
        scratch.start(self, positions, columns, signs);
        match self.block {
            1 => self.walk::<1>(scratch),
            2 => self.walk::<2>(scratch),
            3 => self.walk::<3>(scratch),
            _ => self.walk::<4>(scratch),
        }
    }

    fn walk<const M: usize>(&mut self, scratch: &mut Scratch) -> Result<(), BadPivot> {
        let mut first = 0;
        while let Some(&top) = scratch.from[first..].iter().max() {
            let panel = &mut self.panels[self.panel_of[top as usize] as usize];
            let start = panel.local(top as usize);
            let before = panel.rows.len();
            scratch.enter::<M>(panel, start);
            self.blocks += panel.width * (panel.rows.len() - before);
            let (negative, lanes, loss) = (self.negative, &mut scratch.lanes, &mut scratch.loss);
            let sweep = Sweep::<M> { start, negative, lanes, loss, panel };
            if let Err(bad) = pulp::Arch::new().dispatch(sweep) {
                scratch.index_of.fill(NONE);
                return Err(bad);
            }
            first = panel.width - start;
            std::mem::swap(&mut scratch.from, &mut scratch.to);
            for lane in &mut scratch.lanes {
                std::mem::swap(&mut lane.from, &mut lane.to);
            }
            for (at, &row) in scratch.from.iter().enumerate().skip(first) {
                scratch.index_of[row as usize] = at as u32;
            }
        }
        Ok(())
    }
}

impl Scratch {
    /// Takes up U.
    fn start(
        &mut self,
        factor: &Factor,
        positions: &[u32],
        columns: MatRef<'_, f64>,
        signs: &[f64],
    ) {
        self.index_of.resize(factor.positions(), NONE);
        self.from.clear();
        if signs.is_empty() {
            return;
        }
        self.from.extend_from_slice(positions);
        for (at, &position) in positions.iter().enumerate() {
            self.index_of[position as usize] = at as u32;
        }
        // A quasi-definite K keeps its inertia with all of the change alone, not with part of it.
        let together = factor.negative > 0 && signs.len() <= MOST;
        let of = |sign: f64| (0..signs.len()).filter(move |&q| together || signs[q] == sign);
        let mut order: [Vec<usize>; 2] = [of(1.0).collect(), of(-1.0).collect()];
        if together {
            order[1].clear();
        }
        let parts = order.iter().flat_map(|one| one.chunks(MOST));
        self.lanes.resize_with(parts.clone().count(), Lane::default);
        for (lane, part) in self.lanes.iter_mut().zip(parts) {
            lane.core.start(part.iter().map(|&q| signs[q]), factor.block);
            let (rank, rows) = (part.len(), factor.block * positions.len());
            lane.from.clear();
            lane.from.resize(rows.next_multiple_of(LANES) * rank, 0.0);
            for row in 0..rows {
                let to = place(row, rank);
                for (q, &column) in part.iter().enumerate() {
                    lane.from[to + LANES * q] = columns[(row, column)];
                }
            }
        }
    }

    /// Brings w into the order of a panel's rows from its column `start` on. Rows that the panel
    /// does not have are added to it.
    fn enter<const M: usize>(&mut self, panel: &mut Panel, start: usize) {
        let highest = (panel.low + panel.width - start) as u32;
        self.to.clear();
        self.to.extend((panel.low as u32..highest).rev());
        self.to.extend_from_slice(&panel.rows);
        self.source.clear();
        for &row in &self.to {
            self.source.push(std::mem::replace(&mut self.index_of[row as usize], NONE));
        }
        for (at, &row) in self.from.iter().enumerate() {
            if self.index_of[row as usize] == at as u32 {
                self.index_of[row as usize] = NONE;
                panel.push_row(row, M);
                self.to.push(row);
                self.source.push(at as u32);
            }
        }
        for lane in &mut self.lanes {
            lane.enter::<M>(&self.source);
        }
    }
}

impl Lane {
    /// Moves w_j out of what is carried; false if it is 0.
    #[inline(always)]
    fn take_head<const M: usize>(&mut self, row: usize) -> bool {
        let (rank, padded) = (self.core.rank, self.core.padded);
        let mut any = false;
        for a in 0..M {
            let at = place(M * row + a, rank);
            for q in 0..rank {
                let value = std::mem::take(&mut self.to[at + LANES * q]);
                any |= value != 0.0;
                self.core.head[padded * a + q] = value;
                self.core.head_by_column[M * q + a] = value;
            }
        }
        any
    }

    /// Moves rows from where the last panel had them.
    fn enter<const M: usize>(&mut self, source: &[u32]) {
        let rank = self.core.rank;
        self.to.clear();
        self.to.resize((M * source.len()).next_multiple_of(LANES) * rank, 0.0);
        for (at, &source) in source.iter().enumerate() {
            if source == NONE {
                continue;
            }
            for a in 0..M {
                let from = place(M * source as usize + a, rank);
                let to = place(M * at + a, rank);
                let from = self.from[from..].iter().step_by(LANES).take(rank);
                let to = self.to[to..].iter_mut().step_by(LANES).take(rank);
                to.zip(from).for_each(|(to, &from)| *to = from);
            }
        }
    }
}

/// Where a scalar row of w starts.
#[inline(always)]
fn place(row: usize, rank: usize) -> usize {
    row / LANES * LANES * rank + row % LANES
}

impl Core {
    fn start(&mut self, signs: impl ExactSizeIterator<Item = f64>, block: usize) {
        self.rank = signs.len();
        self.padded = self.rank.next_multiple_of(LANES / 2);
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
struct Sweep<'a, const M: usize> {
    panel: &'a mut Panel,
    start: usize,
    negative: usize,
    lanes: &'a mut [Lane],
    loss: &'a mut f64,
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
fn multiply_add<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

impl<const M: usize> Sweep<'_, M> {
    #[inline(always)]
    fn run<const FUSED: bool>(mut self) -> Result<(), BadPivot> {
        for column in self.start..self.panel.width {
            for lane in 0..self.lanes.len() {
                if self.lanes[lane].take_head::<M>(column - self.start) {
                    self.turn::<FUSED>(column, lane)?;
                    self.rows::<FUSED>(column, lane);
                }
            }
        }
        Ok(())
    }

    /// D' and its factors, G, and Θ for the columns to come.
    #[inline(always)]
    fn turn<const FUSED: bool>(&mut self, column: usize, lane: usize) -> Result<(), BadPivot> {
        let core = &mut self.lanes[lane].core;
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
        let pivot = Pivot::new(&d, &floor, self.negative).map_err(|(row, value)| BadPivot {
            position: self.panel.low + self.panel.width - 1 - column,
            row,
            value,
            limit: floor[row],
        })?;
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
    fn rows<const FUSED: bool>(&mut self, column: usize, lane: usize) {
        let Lane { to: carried, core, .. } = &mut self.lanes[lane];
        let rank = core.rank;
        let first = M * (column + 1 - self.start) / LANES;
        let carried = &mut carried[first * LANES * rank..];
        let offset = M * self.start + first * LANES;
        let stride = self.panel.stride;
        let mut columns = self.panel.values[stride * M * column..stride * M * (column + 1)]
            .chunks_exact_mut(stride);
        let lower: [&mut [[f64; LANES]]; M] = std::array::from_fn(|_| {
            columns.next().map_or(&mut [][..], |c| c[offset..].as_chunks_mut::<LANES>().0)
        });
        let heads = core.head_by_column.as_chunks::<M>().0;
        let gains = core.gain_by_column.as_chunks::<M>().0;
        for (at, chunk) in carried.chunks_exact_mut(LANES * rank).enumerate() {
            let before: [[f64; LANES]; M] = std::array::from_fn(|a| lower[a][at]);
            let mut after = before;
            let chunk = chunk.as_chunks_mut::<LANES>().0;
            for ((w, head), gain) in chunk.iter_mut().zip(heads).zip(gains) {
                let mut x = *w;
                for a in 0..M {
                    for lane in 0..LANES {
                        x[lane] = multiply_add::<FUSED>(-head[a], before[a][lane], x[lane]);
                    }
                }
                *w = x;
                for a in 0..M {
                    for lane in 0..LANES {
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

/// In four sums: one would wait for itself.
#[inline(always)]
fn dot<const FUSED: bool>(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES / 2];
    for (x, y) in x.as_chunks::<{ LANES / 2 }>().0.iter().zip(y.as_chunks::<{ LANES / 2 }>().0) {
        for lane in 0..LANES / 2 {
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
