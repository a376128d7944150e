//! The inner loops over one tile, compiled for each vector unit and chosen at run time.
//!
//! Everything around a pass runs in here too, not for the width alone: faer's kernels may return
//! with the upper halves of the vector registers in use, and code for plain SSE2 then runs at a
//! third of its speed.

use pulp::Simd;

use super::TILE;
use crate::stored::Stored;

/// Rows handled together, so that a vector of the right factor is loaded once for all of them.
const ROWS: usize = 4;

/// Vectors handled together: with [`ROWS`] they fill twelve of sixteen registers with sums.
const VECTORS: usize = 3;

/// T ← T + Lᵀ R: `target` rows × [`TILE`], `left` terms × stride of which the first rows count,
/// `right` terms × [`TILE`].
///
/// The target is meant to be a tile, which stays in the first-level cache while the terms are
/// taken nine at a time: so many fit the registers without a detour, and few panels the cache.
#[inline(always)]
pub(crate) fn accumulate<S: Simd, E: Stored>(
    simd: S,
    target: &mut [E],
    left: &[E],
    stride: usize,
    right: &[E],
) {
    let mut terms = right.as_chunks::<TILE>().0;
    let mut first = 0;
    // A plain split has three terms, rings of mixed tissue a multiple of it.
    while !terms.is_empty() {
        let left = &left[first * stride..];
        let count = match terms.len() {
            9.. => accumulate_terms::<S, E, 9>(simd, target, left, stride, &terms[..9]),
            6.. => accumulate_terms::<S, E, 6>(simd, target, left, stride, &terms[..6]),
            3.. => accumulate_terms::<S, E, 3>(simd, target, left, stride, &terms[..3]),
            _ => accumulate_terms::<S, E, 1>(simd, target, left, stride, &terms[..1]),
        };
        terms = &terms[count..];
        first += count;
    }
}

/// [`accumulate`] for `K` terms; returns K.
#[inline(always)]
fn accumulate_terms<S: Simd, E: Stored, const K: usize>(
    simd: S,
    target: &mut [E],
    left: &[E],
    stride: usize,
    right: &[[E; TILE]],
) -> usize {
    let Some(right) = right.first_chunk::<K>() else { return K };
    let mut row = 0;
    let (fours, rest) = target.as_chunks_mut::<TILE>().0.as_chunks_mut::<ROWS>();
    for four in fours {
        accumulate_rows::<S, E, K, ROWS>(simd, four, &left[row..], stride, right);
        row += ROWS;
    }
    for single in rest.as_chunks_mut::<1>().0 {
        accumulate_rows::<S, E, K, 1>(simd, single, &left[row..], stride, right);
        row += 1;
    }
    K
}

#[inline(always)]
fn accumulate_rows<S: Simd, E: Stored, const K: usize, const R: usize>(
    simd: S,
    target: &mut [[E; TILE]; R],
    left: &[E],
    stride: usize,
    right: &[[E; TILE]; K],
) {
    let rows = target.each_mut().map(|row| E::lanes_mut::<S>(row).as_chunks_mut().0);
    for at in 0..rows[0].len() {
        let mut sums: [[E::Lanes<S>; VECTORS]; R] = std::array::from_fn(|r| rows[r][at]);
        for (k, source) in right.iter().enumerate() {
            let vectors: [E::Lanes<S>; VECTORS] = E::lanes::<S>(source).as_chunks().0[at];
            // Read here, where it is used: held outside of the loop, the factors of all terms
            // would take more registers than there are.
            let factors = &left[k * stride..k * stride + R];
            for r in 0..R {
                let factor = E::splat(simd, factors[r]);
                for v in 0..VECTORS {
                    sums[r][v] = E::mul_add(simd, factor, vectors[v], sums[r][v]);
                }
            }
        }
        for r in 0..R {
            rows[r][at] = sums[r];
        }
    }
}

/// y ← y + T x and, for a tile off the diagonal, z ← z + Tᵀ w, one read of T for both.
///
/// Sums over the tile are in the stored scalar.
#[inline(always)]
pub(crate) fn multiply<S: Simd, E: Stored>(
    simd: S,
    tile: &[E],
    (x, y): (&[E], &mut [f64]),
    mirrored: Option<(&[E], &mut [f64])>,
) {
    let source: [E; TILE] = std::array::from_fn(|j| x[j]);
    let mut sums = [E::default(); TILE];
    let (rows, _) = tile.as_chunks::<TILE>().0.as_chunks::<ROWS>();
    let (w, z) = match mirrored {
        Some((w, z)) => (w, Some(z)),
        None => (&[] as &[E], None),
    };
    for (group, rows) in rows.iter().enumerate() {
        let first = ROWS * group;
        let factors: [E; ROWS] =
            std::array::from_fn(|r| if z.is_some() { w[first + r] } else { E::default() });
        let products = multiply_rows(simd, rows, &source, factors, &mut sums);
        for r in 0..ROWS {
            y[first + r] += products[r].value();
        }
    }
    if let Some(z) = z {
        for j in 0..TILE {
            z[j] += sums[j].value();
        }
    }
}

#[inline(always)]
fn multiply_rows<S: Simd, E: Stored>(
    simd: S,
    rows: &[[E; TILE]; ROWS],
    source: &[E; TILE],
    factors: [E; ROWS],
    sums: &mut [E; TILE],
) -> [E; ROWS] {
    let rows = rows.each_ref().map(|row| E::lanes::<S>(row));
    let (source, sums) = (E::lanes::<S>(source), E::lanes_mut::<S>(sums));
    let factors = factors.map(|factor| E::splat(simd, factor));
    let mut products = [E::splat(simd, E::default()); ROWS];
    for at in 0..sums.len() {
        let (x, mut sum) = (source[at], sums[at]);
        for r in 0..ROWS {
            let entries = rows[r][at];
            products[r] = E::mul_add(simd, entries, x, products[r]);
            sum = E::mul_add(simd, factors[r], entries, sum);
        }
        sums[at] = sum;
    }
    products.map(|product| E::sum(simd, product))
}
