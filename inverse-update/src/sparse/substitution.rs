//! Solving with the factor: forward, divide, backward; several right-hand sides at a time.

use pulp::{Simd, WithSimd};

use super::factor::Factor;
use super::pivot::by_rows;

/// Right-hand sides that share one pass over the factor.
pub(crate) const TOGETHER: usize = 4;

struct Solve<'a, const M: usize, const R: usize> {
    factor: &'a Factor,
    sides: &'a mut [f64],
}

impl<const M: usize, const R: usize> WithSimd for Solve<'_, M, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.factor.solve_sides::<S, M, R>(simd, self.sides);
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
            Some(1) => self.solve_block::<1>(sides),
            Some(2) => self.solve_block::<2>(sides),
            Some(3) => self.solve_block::<3>(sides),
            Some(count) => {
                debug_assert_eq!(count, TOGETHER, "right-hand sides that go together");
                self.solve_block::<TOGETHER>(sides);
            }
        }
    }

    fn solve_block<const R: usize>(&self, sides: &mut [f64]) {
        let arch = pulp::Arch::new();
        by_rows!(self.block, M => arch.dispatch(Solve::<M, R> { factor: self, sides }));
    }

    #[inline(always)]
    fn solve_sides<S: Simd, const M: usize, const R: usize>(&self, simd: S, sides: &mut [f64]) {
        let mut x = self.by_position::<M, R>(sides);
        let mut local = Vec::new();
        for panel in self.panels.iter().rev() {
            panel.forward::<S, M, R>(simd, &mut x, &mut local);
        }
        let length = x.len() / R;
        for panel in &self.panels {
            for x in x.chunks_exact_mut(length) {
                panel.backward::<S, M>(simd, x, &mut local);
            }
        }
        self.by_slot::<M>(&x, sides);
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
