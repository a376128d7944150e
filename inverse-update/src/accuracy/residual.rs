//! What a solution leaves of its load.

use crate::matrix::SparseStiffness;

/// Rounding of a residual, in units of ε (|K| |u| + |f|).
pub(crate) const ROUNDING: f64 = 4.0;

/// r = f − K u; returns ‖D^(−½) r‖ / ‖D^(−½) f‖ with D = |diag K|: 0 if both are 0.
///
/// All slices have `dofs()` numbers. The norm is scaled by the diagonal, so that neither units nor
/// soft tissue beside stiff tissue decide which rows count. One sweep over K finds product, norms
/// and diagonal. Cost: O(stored entries).
pub(crate) fn residual(k: &SparseStiffness, f: &[f64], u: &[f64], r: &mut [f64]) -> f64 {
    let [left, load] = pulp::Arch::new().dispatch(Sweep { k, f, u, r });
    if left == 0.0 { 0.0 } else { (left / load).sqrt() }
}

struct Sweep<'a> {
    k: &'a SparseStiffness,
    f: &'a [f64],
    u: &'a [f64],
    r: &'a mut [f64],
}

impl pulp::WithSimd for Sweep<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> [f64; 2] {
        // Known numbers of rows let the loops over a block be unrolled.
        match self.k.block() {
            3 => self.rows(3),
            4 => self.rows(4),
            m => self.rows(m),
        }
    }
}

impl Sweep<'_> {
    /// rᵀ D⁻¹ r and fᵀ D⁻¹ f.
    #[inline(always)]
    fn rows(self, m: usize) -> [f64; 2] {
        let Self { k, f, u, r } = self;
        let (mut left, mut load) = (0.0, 0.0);
        for (slot, (target, f)) in r.chunks_exact_mut(m).zip(f.chunks_exact(m)).enumerate() {
            target.copy_from_slice(f);
            let mut own: &[f64] = &[];
            let blocks = k.row_values(slot).chunks_exact(m * m);
            for (&column, value) in k.neighbours(slot).iter().zip(blocks) {
                let source = &u[m * column..][..m];
                for a in 0..m {
                    for b in 0..m {
                        target[a] -= value[m * a + b] * source[b];
                    }
                }
                if column == slot {
                    own = value;
                }
            }
            for (a, (r, f)) in target.iter().zip(f).enumerate() {
                let weight = own.get(a * (m + 1)).map_or(f64::INFINITY, |d| 1.0 / d.abs());
                left += weight * r * r;
                load += weight * f * f;
            }
        }
        [left, load]
    }
}

/// Whether a residual of that relative size, in `r`, is more than rounding of K u itself.
pub(crate) fn exceeds_rounding(k: &SparseStiffness, f: &[f64], u: &[f64], r: &[f64]) -> bool {
    let mut rounding = vec![0.0; f.len()];
    k.apply_absolute(u, &mut rounding);
    rounding.iter_mut().zip(f).for_each(|(sum, f)| *sum += f.abs());
    norm(k, r) > ROUNDING * f64::EPSILON * norm(k, &rounding)
}

/// ‖D^(−½) x‖.
pub(crate) fn norm(k: &SparseStiffness, x: &[f64]) -> f64 {
    let square = |(i, x): (usize, &f64)| x * x / k.diagonal(i).abs();
    x.iter().enumerate().map(square).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;

    /// Every number of rows that has a loop of its own, and others.
    #[test]
    fn the_residual_is_that_of_the_dense_matrix() {
        for block in 1..6 {
            let n = 3 * block;
            let mut k = SparseStiffness::zeros(3, block).unwrap();
            let entry = |i: usize, j: usize| ((i * j + 3 * (i + j)) % 7) as f64;
            let part = |rows: usize| {
                Mat::from_fn(rows, rows, |i, j| entry(i, j) + if i == j { 16.0 } else { 0.0 })
            };
            k.add(&[0, 2], part(2 * block).as_ref()).unwrap();
            k.add(&[1], part(block).as_ref()).unwrap();
            let dense = k.to_dense();
            let f: Vec<f64> = (0..n).map(|i| (i % 5) as f64 - 2.0).collect();
            let u: Vec<f64> = (0..n).map(|i| (i % 3) as f64).collect();
            let want: Vec<f64> =
                (0..n).map(|i| f[i] - (0..n).map(|j| dense[(i, j)] * u[j]).sum::<f64>()).collect();
            let size = |x: &[f64]| (0..n).map(|i| x[i] * x[i] / dense[(i, i)]).sum::<f64>().sqrt();
            let mut r = vec![f64::NAN; n];
            let got = residual(&k, &f, &u, &mut r);
            assert_eq!(r, want, "whole numbers are exact");
            let want = size(&want) / size(&f);
            assert!((got / want - 1.0).abs() < 1e-14, "{got} instead of {want}");
        }
    }
}
