//! A solve in the middle of which a few rows tell what they get and add to the load.

use std::marker::PhantomData;

use pulp::{Simd, WithSimd};

use super::factor::Factor;
use super::lower::Digits;
use super::pivot::by_rows;

struct Reply<'a, 'b, T, const M: usize> {
    factor: &'a Factor,
    side: &'a mut [f64],
    rows: &'a [usize],
    reply: &'a mut (dyn FnMut(&[f64]) -> Vec<f64> + 'b),
    digits: PhantomData<T>,
}

impl<T: Digits, const M: usize> WithSimd for Reply<'_, '_, T, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.factor.solve_and_reply::<S, T, M>(simd, self.side, self.rows, self.reply);
    }
}

impl Factor {
    /// Solves L D Lᵀ x = b + e in place, where e acts on `rows` alone (`block` per slot) and `reply`
    /// chooses it by the solution without it there.
    ///
    /// That solution is followed from the root down to `rows` and no further, and e up again: beside a
    /// solve, two passes over the panels on the paths of `rows`.
    pub(crate) fn solve_with_reply(
        &self,
        side: &mut [f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
    ) {
        self.reply_in::<f64>(side, rows, reply);
    }

    /// The same with the digits of [`precondition`](Self::precondition).
    pub(crate) fn precondition_with_reply(
        &self,
        side: &mut [f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
    ) {
        match self.may_round {
            true => self.reply_in::<f32>(side, rows, reply),
            false => self.reply_in::<f64>(side, rows, reply),
        }
    }

    fn reply_in<T: Digits>(
        &self,
        side: &mut [f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
    ) {
        let (arch, factor, digits) = (pulp::Arch::new(), self, PhantomData::<T>);
        by_rows!(self.block, M => {
            arch.dispatch(Reply::<T, M> { factor, side, rows, reply, digits });
        });
    }

    #[inline(always)]
    fn solve_and_reply<S: Simd, T: Digits, const M: usize>(
        &self,
        simd: S,
        side: &mut [f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
    ) {
        let place = |row: usize| M * self.position_of[row / M] as usize + row % M;
        let path = self.path(rows.iter().map(|row| self.position_of[row / M]));
        let mut x = self.by_position::<M, 1>(side);
        let mut local = Vec::new();
        for panel in self.panels.iter().rev() {
            panel.forward::<S, T, M, 1>(simd, &mut x, &mut local);
        }
        let mut there = x.clone();
        for &panel in &path {
            self.panels[panel].backward::<S, T, M>(simd, &mut there, &mut local);
        }
        let values: Vec<f64> = rows.iter().map(|&row| there[place(row)]).collect();
        let mut more = vec![0.0; x.len()];
        for (&row, force) in rows.iter().zip(reply(&values)) {
            more[place(row)] += force;
        }
        for &panel in path.iter().rev() {
            self.panels[panel].forward::<S, T, M, 1>(simd, &mut more, &mut local);
        }
        x.iter_mut().zip(&more).for_each(|(x, more)| *x += more);
        for panel in &self.panels {
            panel.backward::<S, T, M>(simd, &mut x, &mut local);
        }
        self.by_slot::<M>(&x, side);
    }

    /// The panels that some positions reach, the root's first.
    pub(super) fn path(&self, positions: impl Iterator<Item = u32>) -> Vec<usize> {
        let mut is_on_path = vec![false; self.panels.len()];
        for position in positions {
            is_on_path[self.panel_of[position as usize] as usize] = true;
        }
        for at in (0..self.panels.len()).rev() {
            if is_on_path[at] {
                for &row in &self.panels[at].rows {
                    is_on_path[self.panel_of[row as usize] as usize] = true;
                }
            }
        }
        (0..self.panels.len()).filter(|&at| is_on_path[at]).collect()
    }
}
