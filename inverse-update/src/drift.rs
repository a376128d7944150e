//! How far a kept inverse has drifted from the matrix.

use crate::InverseMaintainer;

/// The largest s_j = √|K_jj| ‖D^(−½)(K c_j − e_j)‖ over random columns j, D = |diag K|.
///
/// Dimensionless: independent of units and of the ratio of moduli. Infinite if anything on the
/// way is not finite; 0 without vertices or samples. `seed` picks the columns.
/// Cost: O(samples) columns and products with the sparse K.
#[must_use]
pub fn drift(maintainer: &dyn InverseMaintainer, seed: u64, samples: usize) -> f64 {
    let k = maintainer.stiffness();
    let (n, block) = (k.dofs(), k.block());
    if n == 0 {
        return 0.0;
    }
    let mut worst: f64 = 0.0;
    let mut state = seed;
    let mut residual = vec![0.0; n];
    for _ in 0..samples {
        let j = (random(&mut state) % n as u64) as usize;
        let Ok(columns) = maintainer.columns(&[j / block]) else { return f64::INFINITY };
        if k.apply(columns.col_as_slice(j % block), &mut residual).is_err() {
            return f64::INFINITY;
        }
        residual[j] -= 1.0;
        let sum: f64 = residual.iter().enumerate().map(|(i, r)| r * r / k.diagonal(i).abs()).sum();
        let s = k.diagonal(j).abs().sqrt() * sum.sqrt();
        // `f64::max` would hide a NaN.
        worst = if s.is_finite() { worst.max(s) } else { f64::INFINITY };
    }
    worst
}

/// SplitMix64 (Steele, Lea, Flood 2014): good enough to pick columns, the same everywhere.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
