//! Solving with the factor: forward, divide, backward; several right-hand sides at a time.

use super::factor::Factor;
use super::pivot::Pivot;

/// Right-hand sides that share one pass over the factor.
pub(crate) const TOGETHER: usize = 4;

impl Factor {
    /// Solves L D Lᵀ x = b in place for up to [`TOGETHER`] right-hand sides, each with `block`
    /// numbers per slot. Columns of the factor that a right-hand side doesn't reach are skipped.
    ///
    /// Cost: two passes over the factor's blocks.
    pub(crate) fn solve(&self, sides: &mut [&mut [f64]]) {
        match (self.block, sides) {
            (m, [one]) => self.solve_block::<1>(m, [one]),
            (m, [one, two]) => self.solve_block::<2>(m, [one, two]),
            (m, [one, two, three]) => self.solve_block::<3>(m, [one, two, three]),
            (m, [one, two, three, four]) => self.solve_block::<4>(m, [one, two, three, four]),
            (_, _) => debug_assert!(false, "more right-hand sides than go together"),
        }
    }

    fn solve_block<const R: usize>(&self, block: usize, sides: [&mut &mut [f64]; R]) {
        match block {
            1 => self.solve_sides::<1, R>(sides),
            2 => self.solve_sides::<2, R>(sides),
            3 => self.solve_sides::<3, R>(sides),
            _ => self.solve_sides::<4, R>(sides),
        }
    }

    fn solve_sides<const M: usize, const R: usize>(&self, mut sides: [&mut &mut [f64]; R]) {
        // By position: rows of a panel are near each other there.
        let mut x = vec![[0.0; R]; M * self.positions()];
        for (slot, &position) in self.position_of.iter().enumerate() {
            for a in 0..M {
                for (r, side) in sides.iter().enumerate() {
                    x[M * position as usize + a][r] = side[M * slot + a];
                }
            }
        }
        let mut local = Vec::new();
        for panel in (0..self.panels.len()).rev() {
            self.forward::<M, R>(panel, &mut x, &mut local);
        }
        for panel in 0..self.panels.len() {
            self.backward::<M, R>(panel, &mut x, &mut local);
        }
        for (slot, &position) in self.position_of.iter().enumerate() {
            for a in 0..M {
                for (r, side) in sides.iter_mut().enumerate() {
                    side[M * slot + a] = x[M * position as usize + a][r];
                }
            }
        }
    }

    /// x ← L⁻¹ x, then the panel's own rows of D⁻¹ x.
    fn forward<const M: usize, const R: usize>(
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
        // What is taken off the rows: the panel's own first, highest position first.
        local.clear();
        local.resize(M * (panel.width + panel.rows.len()), [0.0; R]);
        for column in 0..panel.width {
            let first = M * (panel.low + panel.width - 1 - column);
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
            for a in 0..M {
                let values = &panel.values[panel.stride * (M * column + a)..][M * (column + 1)..];
                let factors: [f64; R] = std::array::from_fn(|r| head[r][a]);
                for (sum, &l) in below.iter_mut().zip(values) {
                    for r in 0..R {
                        sum[r] += l * factors[r];
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
    fn backward<const M: usize, const R: usize>(
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
            let first = M * (panel.low + panel.width - 1 - column);
            for a in 0..M {
                let values = &panel.values[panel.stride * (M * column + a)..][M * (column + 1)..];
                let sum = product(values, &local[M * (column + 1)..]);
                for r in 0..R {
                    x[first + a][r] -= sum[r];
                    local[M * column + a][r] = x[first + a][r];
                }
            }
        }
    }
}

/// Σ l_i x_i, in several sums that do not wait for each other.
fn product<const R: usize>(l: &[f64], x: &[[f64; R]]) -> [f64; R] {
    const SUMS: usize = 8;
    let mut sums = [[0.0; R]; SUMS];
    let (whole, rest) = x.as_chunks::<SUMS>();
    for (l, x) in l.as_chunks::<SUMS>().0.iter().zip(whole) {
        for at in 0..SUMS {
            for r in 0..R {
                sums[at][r] += l[at] * x[at][r];
            }
        }
    }
    for (at, (&l, x)) in l[x.len() - rest.len()..].iter().zip(rest).enumerate() {
        for r in 0..R {
            sums[at][r] += l * x[r];
        }
    }
    let mut total = [0.0; R];
    for r in 0..R {
        for pair in 0..SUMS / 2 {
            total[r] += sums[2 * pair][r] + sums[2 * pair + 1][r];
        }
    }
    total
}
