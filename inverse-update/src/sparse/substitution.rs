//! Solving with the factor: forward, divide, backward; several right-hand sides at a time.

use pulp::{Simd, WithSimd};

use super::factor::{Factor, Panel};
use super::pivot::{Pivot, by_rows};

/// Right-hand sides that share one pass over the factor.
pub(crate) const TOGETHER: usize = 4;

struct Solve<'a, const M: usize, const R: usize> {
    factor: &'a Factor,
    sides: &'a mut [f64],
}

impl<const M: usize, const R: usize> WithSimd for Solve<'_, M, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.factor.solve_sides::<M, R>(self.sides);
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
    fn solve_sides<const M: usize, const R: usize>(&self, sides: &mut [f64]) {
        let mut x = self.by_position::<M, R>(sides);
        let mut local = Vec::new();
        for panel in (0..self.panels.len()).rev() {
            self.forward::<M, R>(panel, &mut x, &mut local);
        }
        for panel in 0..self.panels.len() {
            self.backward::<M, R>(panel, &mut x, &mut local);
        }
        self.by_slot::<M, R>(&x, sides);
    }

    /// Right-hand sides in the order of positions: rows of a panel are near each other there.
    #[inline(always)]
    pub(super) fn by_position<const M: usize, const R: usize>(
        &self,
        sides: &[f64],
    ) -> Vec<[f64; R]> {
        let mut x = vec![[0.0; R]; M * self.positions()];
        let n = M * self.vertices();
        for (slot, &position) in self.position_of.iter().enumerate() {
            for a in 0..M {
                for r in 0..R {
                    x[M * position as usize + a][r] = sides[n * r + M * slot + a];
                }
            }
        }
        x
    }

    /// The reverse of [`by_position`](Self::by_position).
    #[inline(always)]
    pub(super) fn by_slot<const M: usize, const R: usize>(
        &self,
        x: &[[f64; R]],
        sides: &mut [f64],
    ) {
        let n = M * self.vertices();
        for (slot, &position) in self.position_of.iter().enumerate() {
            for a in 0..M {
                for r in 0..R {
                    sides[n * r + M * slot + a] = x[M * position as usize + a][r];
                }
            }
        }
    }

    /// x ← L⁻¹ x, then the panel's own rows of D⁻¹ x.
    #[inline(always)]
    pub(crate) fn forward<const M: usize, const R: usize>(
        &self,
        at: usize,
        x: &mut [[f64; R]],
        local: &mut Vec<[f64; R]>,
    ) {
        let panel = &self.panels[at];
        let own = M * panel.low..M * (panel.low + panel.width);
        if x[own.clone()].as_flattened().iter().all(|&value| value == 0.0) {
            return;
        }
        // What is subtracted from the rows: the panel's own first, highest position first.
        local.clear();
        local.resize(M * (panel.width + panel.rows.len()), [0.0; R]);
        for column in 0..panel.width {
            let first = M * panel.position(column);
            let mut head = [[0.0; M]; R];
            for a in 0..M {
                for r in 0..R {
                    x[first + a][r] -= local[M * column + a][r];
                    head[r][a] = x[first + a][r];
                }
            }
            if head.as_flattened().iter().all(|&value| value == 0.0) {
                continue;
            }
            let below = &mut local[M * (column + 1)..];
            let lower = panel.below::<M>(column, below.len());
            for (i, sum) in below.iter_mut().enumerate() {
                for a in 0..M {
                    for r in 0..R {
                        sum[r] += lower[a][i] * head[r][a];
                    }
                }
            }
            let pivot = Pivot::<M>::read(&panel.pivots[M * M * column..M * M * (column + 1)]);
            for r in 0..R {
                pivot.solve(&mut head[r]);
                for a in 0..M {
                    x[first + a][r] = head[r][a];
                }
            }
        }
        for (&row, sums) in panel.rows.iter().zip(local[M * panel.width..].as_chunks::<M>().0) {
            for a in 0..M {
                for r in 0..R {
                    x[M * row as usize + a][r] -= sums[a][r];
                }
            }
        }
    }

    /// The panel's own rows of x ← L⁻ᵀ x.
    #[inline(always)]
    pub(super) fn backward<const M: usize, const R: usize>(
        &self,
        at: usize,
        x: &mut [[f64; R]],
        local: &mut Vec<[f64; R]>,
    ) {
        let panel = &self.panels[at];
        local.clear();
        local.resize(M * panel.width, [0.0; R]);
        for &row in &panel.rows {
            local.extend_from_slice(&x[M * row as usize..M * (row as usize + 1)]);
        }
        for column in (0..panel.width).rev() {
            let first = M * panel.position(column);
            let below = &local[M * (column + 1)..];
            let sums = products(panel.below::<M>(column, below.len()), below);
            for a in 0..M {
                for r in 0..R {
                    x[first + a][r] -= sums[a][r];
                    local[M * column + a][r] = x[first + a][r];
                }
            }
        }
    }
}

impl Panel {
    /// The scalar columns of a block column, below the diagonal block.
    #[inline(always)]
    fn below<const M: usize>(&self, column: usize, length: usize) -> [&[f64]; M] {
        std::array::from_fn(|a| {
            let first = self.stride * (M * column + a) + M * (column + 1);
            &self.values[first..first + length]
        })
    }
}

/// Σ_i l_i x_i for every column l and right-hand side, in four sums each, so that additions don't
/// wait for each other.
#[inline(always)]
fn products<const M: usize, const R: usize>(l: [&[f64]; M], x: &[[f64; R]]) -> [[f64; R]; M] {
    const SUMS: usize = 4;
    let mut sums = [[[0.0; R]; SUMS]; M];
    let (whole, rest) = x.as_chunks::<SUMS>();
    let chunks = l.map(|l| l.as_chunks::<SUMS>().0);
    for (at, x) in whole.iter().enumerate() {
        for a in 0..M {
            let l = chunks[a][at];
            for lane in 0..SUMS {
                for r in 0..R {
                    sums[a][lane][r] += l[lane] * x[lane][r];
                }
            }
        }
    }
    for (i, x) in rest.iter().enumerate() {
        for a in 0..M {
            for r in 0..R {
                sums[a][i][r] += l[a][SUMS * whole.len() + i] * x[r];
            }
        }
    }
    sums.map(|s| std::array::from_fn(|r| (s[0][r] + s[1][r]) + (s[2][r] + s[3][r])))
}
