//! The factor of a matrix from scratch, panel by panel.

use super::factor::{Factor, NONE, Panel};
use super::panel_kernels::{PanelColumns, Scaled, Subtract};
use super::pattern::Pattern;
use super::pivot::{BadPivot, by_rows};
use super::symbolic::Symbolic;

/// Block columns of a panel that are eliminated, or read, at once: so many stay in the cache.
const TOGETHER: usize = 16;

/// Fewer multiplications than this are not worth a second thread.
const WORTH_TWO: f64 = 3e7;

impl Factor {
    /// Factors a matrix in an order. Two threads take a part of the tree each, if there are two; sums are made in
    /// the same order in any case. Cost: the operations of the factorisation.
    /// # Errors
    /// [`BadPivot`] where a pivot has the wrong sign or is lost in rounding.
    pub(crate) fn new(pattern: &Pattern, symbolic: &Symbolic) -> Result<Self, BadPivot> {
        let mut factor = Self::zeros(pattern, symbolic);
        by_rows!(factor.block, M => factor.factor::<M>(pattern, WORTH_TWO))?;
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

    /// Two parts, if it takes `worth_two` multiplications.
    fn factor<const M: usize>(
        &mut self,
        pattern: &Pattern,
        worth_two: f64,
    ) -> Result<(), BadPivot> {
        let Parts { top, middle } = Parts::of(&self.panels, &self.panel_of, M, worth_two);
        let elimination = Elimination {
            pattern,
            negative: self.negative,
            slot_of: &self.slot_of,
            position_of: &self.position_of,
            panel_of: &self.panel_of,
            limit: (M * pattern.vertices()) as f64 * f64::EPSILON,
        };
        let (above, below) = self.panels.split_at_mut(top);
        if middle > top {
            let (one, other) = below.split_at_mut(middle - top);
            // What the other part changes above.
            let like = |panel: &Panel| Panel::zeros(panel.low, panel.width, panel.rows.clone(), M);
            let mut changes: Vec<Panel> = above.iter().map(like).collect();
            let (one, other) = rayon::join(
                || elimination.run::<M>(above, one, top),
                || elimination.run::<M>(&mut changes, other, middle),
            );
            one.and(other)?;
            for (panel, change) in above.iter_mut().zip(&changes) {
                let sums = panel.values.iter_mut().zip(change.values.iter());
                sums.for_each(|(sum, change)| *sum += change);
            }
        } else {
            elimination.run::<M>(above, below, top)?;
        }
        elimination.run::<M>(&mut [], above, 0)
    }
}

/// How two threads share the panels: `top..middle`, `middle..`, and when both are done `..top`.
struct Parts {
    top: usize,
    middle: usize,
}

impl Parts {
    /// Below a chain of panels from the root are subtrees, one after the other: the chain, and the place between two of
    /// them, with which both parts and then the chain take the least time. None is a part of its own where all of them
    /// take less than `worth_two` multiplications.
    fn of(panels: &[Panel], panel_of: &[u32], block: usize, worth_two: f64) -> Self {
        let size = (block as f64).powi(3);
        let column = |panel: &Panel, at: usize| (panel.width - at + panel.rows.len()) as f64;
        let columns = |p: &Panel| (0..p.width).map(|at| 0.5 * column(p, at).powi(2)).sum::<f64>();
        let own: Vec<f64> = panels.iter().map(|panel| size * columns(panel)).collect();
        // Operations and panels of each subtree.
        let mut subtrees: Vec<(f64, usize)> = own.iter().map(|own| (*own, 1)).collect();
        for (at, panel) in panels.iter().enumerate().rev() {
            if let Some(&row) = panel.rows.first() {
                let (operations, count) = subtrees[at];
                let above = &mut subtrees[panel_of[row as usize] as usize];
                *above = (above.0 + operations, above.1 + count);
            }
        }
        let all: f64 = own.iter().sum();
        let (mut best, mut least) = (Self { top: 0, middle: 0 }, all);
        let (mut top, mut chain) = (0, 0.0);
        while all >= worth_two && top < panels.len() && chain + 0.5 * (all - chain) < least {
            let (mut middle, mut first) = (top, 0.0);
            while middle < panels.len() {
                first += subtrees[middle].0;
                middle += subtrees[middle].1;
                let time = chain + first.max(all - chain - first);
                if time < least {
                    (best, least) = (Self { top, middle }, time);
                }
            }
            chain += own[top];
            top += 1;
        }
        best
    }
}

/// What all panels of a factor are made with.
struct Elimination<'a> {
    pattern: &'a Pattern,
    negative: usize,
    slot_of: &'a [u32],
    position_of: &'a [u32],
    panel_of: &'a [u32],
    /// The least pivot, relative to the entry of K.
    limit: f64,
}

impl Elimination<'_> {
    /// The panels `own`, of which the first has the number `first`, and what they change in those of `top`, numbers
    /// from 0.
    fn run<const M: usize>(
        &self,
        top: &mut [Panel],
        own: &mut [Panel],
        first: usize,
    ) -> Result<(), BadPivot> {
        let mut index_of = vec![NONE; self.slot_of.len()];
        let mut scaled = Scaled { values: Vec::new(), columns: 0 };
        for at in (0..own.len()).rev() {
            let (above, panel) = own.split_at_mut(at);
            let panel = &mut panel[0];
            self.assemble(panel, &mut index_of);
            panel.factor::<M>(self.negative, &mut scaled, |position, a| {
                self.limit * self.pattern.diagonal(self.slot_of[position] as usize, a)
            })?;
            let (mut local, mut done) = (Vec::with_capacity(panel.rows.len()), 0);
            while let Some(&row) = panel.rows.get(done) {
                let number = self.panel_of[row as usize] as usize;
                let target = match number.checked_sub(first) {
                    Some(at) => &mut above[at],
                    None => &mut top[number],
                };
                done += panel.subtract::<M>(done, &scaled, target, &mut index_of, &mut local);
            }
        }
        Ok(())
    }

    /// Adds K where L and D will be; its diagonal blocks to the panel's values.
    fn assemble(&self, panel: &mut Panel, index_of: &mut [u32]) {
        let m = self.pattern.block;
        for (at, row) in panel.positions_from(0).enumerate() {
            index_of[row] = at as u32;
        }
        for column in 0..panel.width {
            let position = panel.position(column);
            let slot = self.slot_of[position] as usize;
            for (other, block) in self.pattern.row(slot) {
                let row = self.position_of[other] as usize;
                if row > position {
                    continue;
                }
                let first = m * index_of[row] as usize;
                for (b, entries) in block.chunks_exact(m).enumerate() {
                    let to = &mut panel.values[panel.stride * (m * column + b) + first..];
                    to.iter_mut().zip(entries).for_each(|(to, entry)| *to += entry);
                }
            }
        }
    }
}

impl Panel {
    /// L and D of the panel's own columns, with L D on the rows below them.
    fn factor<const M: usize>(
        &mut self,
        negative: usize,
        scaled: &mut Scaled<M>,
        floor: impl Fn(usize, usize) -> f64,
    ) -> Result<(), BadPivot> {
        let rows = self.width + self.rows.len();
        scaled.columns = M * self.width;
        // What was there is written before it is read.
        scaled.values.resize(scaled.values.len().max(M * self.width * rows), [0.0; M]);
        let floors: Vec<[f64; M]> = (0..self.width)
            .map(|column| std::array::from_fn(|a| floor(self.position(column), a)))
            .collect();
        let local: Vec<usize> = (0..rows).collect();
        for first in (0..self.width).step_by(TOGETHER) {
            let end = (first + TOGETHER).min(self.width);
            let floors = &floors[..];
            let kernel = PanelColumns::<M> { panel: self, first, end, scaled, negative, floors };
            pulp::Arch::new().dispatch(kernel)?;
            // What these columns change in those behind them.
            let (done, target) = self.values.split_at_mut(self.stride * M * end);
            pulp::Arch::new().dispatch(Subtract::<M> {
                lower: &done[self.stride * M * first..],
                stride: self.stride,
                from: first,
                to: end,
                scaled,
                first: end,
                count: self.width - end,
                local: &local[end..],
                target,
                offset: end,
                target_stride: self.stride,
            });
        }
        // The factorisation leaves values above the diagonal; kernels need zeros there.
        for column in 0..M * self.width {
            let zeros = M * (column / M + 1);
            self.values[self.stride * column..self.stride * column + zeros].fill(0.0);
        }
        Ok(())
    }

    /// Subtracts L (L D)ᵀ, from row `done` on, from the panel above that has the first of them among its columns. The rows
    /// are in elimination order here. Returns how many are columns there.
    fn subtract<const M: usize>(
        &self,
        done: usize,
        scaled: &Scaled<M>,
        target: &mut Panel,
        index_of: &mut [u32],
        local: &mut Vec<usize>,
    ) -> usize {
        for (at, &row) in target.rows.iter().enumerate() {
            index_of[row as usize] = (target.width + at) as u32;
        }
        let here = |row: u32| row as usize >= target.low;
        let count = self.rows[done..].iter().take_while(|&&row| here(row)).count();
        local.clear();
        local.extend(self.rows[done..].iter().map(|&row| {
            let at = row as usize;
            if here(row) { target.local(at) } else { index_of[at] as usize }
        }));
        for from in (0..self.width).step_by(TOGETHER) {
            pulp::Arch::new().dispatch(Subtract::<M> {
                lower: &self.values[self.stride * M * from..],
                stride: self.stride,
                from,
                to: (from + TOGETHER).min(self.width),
                scaled,
                first: self.width + done,
                count,
                local,
                target: &mut target.values,
                offset: 0,
                target_stride: target.stride,
            });
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::super::dissection;
    use super::*;
    use crate::SparseStiffness;
    use faer::Mat;

    /// A held beam of 2 × 2 × `length` vertices, all of one cube tied to each other.
    fn beam(length: usize) -> Pattern {
        let n = 4 * length;
        let mut k = SparseStiffness::quasi_definite(n, 4, 1).unwrap();
        let keys = (0..n).map(|v| ((v % 2) | ((v / 2 % 2) << 21) | ((v / 4) << 42)) as u64);
        k.set_order_keys(&keys.collect::<Vec<_>>()).unwrap();
        let sign = |i: usize| if i % 4 == 3 { -1.0 } else { 1.0 };
        for cube in 0..length - 1 {
            let corners: Vec<usize> = (4 * cube..4 * cube + 8).collect();
            let tie = Mat::from_fn(32, 32, |i, j| match i.abs_diff(j) {
                0 => 9.0 * sign(i),
                of if of % 4 == 0 => -sign(i) / (1 + cube) as f64,
                _ => 0.1,
            });
            k.add(&corners, tie.as_ref()).unwrap();
        }
        Pattern::of(&k)
    }

    fn solution(factor: &Factor, load: &[f64]) -> Vec<f64> {
        let load = Mat::from_fn(load.len(), 1, |i, _| load[i]);
        factor.solve_columns(load.as_ref()).col_as_slice(0).to_vec()
    }

    #[test]
    fn two_parts_give_the_same_bits_on_any_number_of_threads_and_solve_k() {
        let pattern = beam(60);
        let symbolic = Symbolic::new(&pattern, dissection::order(&pattern));
        let made = |worth_two: f64, threads: usize| {
            let mut factor = Factor::zeros(&pattern, &symbolic);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| factor.factor::<4>(&pattern, worth_two)).unwrap();
            factor
        };
        let x: Vec<f64> = (0..960).map(|i| (i % 7) as f64 - 3.0).collect();
        let load = pattern.multiply(&x);
        let [whole, one, two] =
            [(f64::INFINITY, 1), (0.0, 1), (0.0, 2)].map(|(worth, threads)| made(worth, threads));
        for factor in [&whole, &one] {
            let found = solution(factor, &load);
            let off = found.iter().zip(&x).map(|(found, x)| (found - x).abs()).fold(0.0, f64::max);
            assert!(off < 1e-12, "{off:e}");
        }
        assert_eq!(solution(&one, &load), solution(&two, &load));
        let Parts { top, middle } = Parts::of(&whole.panels, &whole.panel_of, 4, 0.0);
        let of = |panels: &[Panel]| panels.iter().map(Panel::blocks).sum::<usize>() as f64;
        let share = of(&whole.panels[top..middle]) / whole.blocks as f64;
        assert!((0.4..0.6).contains(&share), "the first part has {share}");
        assert_eq!(Parts::of(&whole.panels, &whole.panel_of, 4, f64::INFINITY).middle, 0);
    }

    #[test]
    fn bad_pivots_of_either_part_are_found() {
        for bad in [2, 118, 239] {
            let mut pattern = beam(60);
            let own = pattern.row(bad).position(|(j, _)| j == bad).unwrap();
            let at = 16 * (pattern.starts[bad] + own);
            pattern.values[at] = -50.0;
            let symbolic = Symbolic::new(&pattern, dissection::order(&pattern));
            let mut factor = Factor::zeros(&pattern, &symbolic);
            let found = factor.factor::<4>(&pattern, 0.0).unwrap_err();
            assert_eq!((factor.slot_of[found.position] as usize, found.row), (bad, 0));
        }
    }
}
