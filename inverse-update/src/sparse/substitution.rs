//! Solving with the factor: forward, divide, backward; several right-hand sides at a time.

use std::marker::PhantomData;

use faer::{Mat, MatRef};
use pulp::{Simd, WithSimd};

use super::factor::Factor;
use super::lower::Digits;
use super::pattern::Pattern;
use super::pivot::by_rows;
use crate::accuracy::random;

/// Right-hand sides that share one pass over the factor.
pub(crate) const TOGETHER: usize = 4;

/// The part of a solution's energy that what an L in f32 leaves off may have: a hundredth in the norm of energy, less
/// than what the body's rotations make a preconditioner miss.
const ROUNDED: f64 = 1e-4;

struct Solve<'a, T, const M: usize, const R: usize> {
    factor: &'a Factor,
    sides: &'a mut [f64],
    digits: PhantomData<T>,
}

impl<T: Digits, const M: usize, const R: usize> WithSimd for Solve<'_, T, M, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.factor.solve_sides::<S, T, M, R>(simd, self.sides);
    }
}

impl Factor {
    /// Solves L D Lᵀ x = b in place for up to [`TOGETHER`] right-hand sides, one after the other,
    /// each with `block` numbers per slot. Columns of the factor that a right-hand side doesn't
    /// reach are skipped.
    ///
    /// Cost: two passes over the factor's blocks.
    pub(crate) fn solve(&self, sides: &mut [f64]) {
        match sides.len().checked_div(self.block * self.vertices()) {
            None => {}
            Some(1) => self.solve_block::<f64, 1>(sides),
            Some(2) => self.solve_block::<f64, 2>(sides),
            Some(3) => self.solve_block::<f64, 3>(sides),
            Some(count) => {
                debug_assert_eq!(count, TOGETHER, "right-hand sides that go together");
                self.solve_block::<f64, TOGETHER>(sides);
            }
        }
    }

    /// As [`solve`](Self::solve) for the columns of X, [`TOGETHER`] of them at a time.
    pub(crate) fn solve_columns(&self, x: MatRef<'_, f64>) -> Mat<f64> {
        let n = x.nrows();
        let mut flat: Vec<f64> = x.col_iter().flat_map(|column| column.iter().copied()).collect();
        for group in flat.chunks_mut((TOGETHER * n).max(1)) {
            self.solve(group);
        }
        MatRef::from_column_major_slice(&flat, n, x.ncols()).to_owned()
    }

    /// As [`solve`](Self::solve) for one right-hand side, with L in f32 where it
    /// [may be rounded](Self::may_round).
    pub(crate) fn precondition(&self, side: &mut [f64]) {
        match self.may_round {
            true => self.solve_block::<f32, 1>(side),
            false => self.solve_block::<f64, 1>(side),
        }
    }

    fn solve_block<T: Digits, const R: usize>(&self, sides: &mut [f64]) {
        let arch = pulp::Arch::new();
        let digits = PhantomData::<T>;
        by_rows!(self.block, M => arch.dispatch(Solve::<T, M, R> { factor: self, sides, digits }));
    }

    #[inline(always)]
    fn solve_sides<S: Simd, T: Digits, const M: usize, const R: usize>(
        &self,
        simd: S,
        sides: &mut [f64],
    ) {
        let mut x = self.by_position::<M, R>(sides);
        let mut local = Vec::new();
        for panel in self.panels.iter().rev() {
            panel.forward::<S, T, M, R>(simd, &mut x, &mut local);
        }
        let length = x.len() / R;
        for panel in &self.panels {
            for x in x.chunks_exact_mut(length) {
                panel.backward::<S, T, M>(simd, x, &mut local);
            }
        }
        self.by_slot::<M>(&x, sides);
    }

    /// Finds whether who preconditions [may read](Self::may_round) L in f32: whether what is missed of a random x in
    /// solving for K x has no more than [`ROUNDED`] of its energy. K is L D Lᵀ with D as it is, so that it stays
    /// definite; but forces that cancel on a stiff part in soft surroundings no longer quite do, and move it.
    ///
    /// Cost: a solve and two products with K. Leaves the copy that is read from now on.
    pub(crate) fn try_rounding(&mut self, pattern: &Pattern) {
        let m = self.block;
        let mut state = self.vertices() as u64;
        let entry = |i: usize| {
            let sign = if random(&mut state) & 1 == 0 { 1.0 } else { -1.0 };
            sign / pattern.diagonal(i / m, i % m).sqrt()
        };
        let x: Vec<f64> = (0..m * self.vertices()).map(entry).collect();
        // What couples rows of either sign cancels in this sum.
        let energy = |x: &[f64], product: &[f64]| -> f64 {
            let sign = |i: usize| if i % m + self.negative < m { 1.0 } else { -1.0 };
            (0..x.len()).map(|i| sign(i) * x[i] * product[i]).sum()
        };
        let load = pattern.multiply(&x);
        let whole = energy(&x, &load);
        let mut missed = load;
        self.solve_block::<f32, 1>(&mut missed);
        missed.iter_mut().zip(&x).for_each(|(missed, x)| *missed -= x);
        self.may_round = energy(&missed, &pattern.multiply(&missed)) <= ROUNDED * whole;
        if !self.may_round {
            self.panels.iter_mut().for_each(|panel| panel.values.forget());
        }
    }

    /// R right-hand sides in the order of positions: rows of a panel are near each other there.
    pub(super) fn by_position<const M: usize, const R: usize>(&self, sides: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; R * M * self.positions()];
        let sides = sides.as_chunks::<M>().0.chunks_exact(self.vertices().max(1));
        let by_position = x.as_chunks_mut::<M>().0.chunks_exact_mut(self.positions().max(1));
        for (x, side) in by_position.zip(sides) {
            for (block, &position) in side.iter().zip(&self.position_of) {
                x[position as usize] = *block;
            }
        }
        x
    }

    /// The reverse of [`by_position`](Self::by_position).
    pub(super) fn by_slot<const M: usize>(&self, x: &[f64], sides: &mut [f64]) {
        let sides = sides.as_chunks_mut::<M>().0.chunks_exact_mut(self.vertices().max(1));
        let by_position = x.as_chunks::<M>().0.chunks_exact(self.positions().max(1));
        for (x, side) in by_position.zip(sides) {
            for (block, &position) in side.iter_mut().zip(&self.position_of) {
                *block = x[position as usize];
            }
        }
    }
}
