//! The inner loops over one tile, compiled for each vector unit and chosen at run time.
//!
//! Everything around a pass runs in here too, not for the width alone: faer's kernels may return
//! with the upper halves of the vector registers in use, and code for plain SSE2 then runs at a
//! third of its speed.

use pulp::Simd;

use super::tile::{TILE, Tile};
use crate::dense::precision::Precision;

/// Rows handled together, so that a vector of the right factor is loaded once for all of them.
const ROWS: usize = 4;

/// Vectors handled together: with [`ROWS`] they fill twelve of sixteen registers with sums.
const VECTORS: usize = 3;

/// The same where there are 32 registers, of fewer than 512 bits.
const MORE_VECTORS: usize = 6;

/// Terms added at a time.
const MOST_TERMS: usize = 4;

/// T ← T + Lᵀ R: `target` rows × [`TILE`], `left` terms × stride of which the first rows count,
/// `right` terms × [`TILE`].
#[inline(always)]
pub(crate) fn accumulate<S: Simd, E: Precision>(
    simd: S,
    target: &mut [E],
    left: &[E],
    stride: usize,
    right: &[E],
) {
    let rows = target.as_chunks_mut::<TILE>().0;
    let right = right.as_chunks::<TILE>().0;
    accumulate_groups(simd, rows, |k| &left[k * stride..], right.len(), |k| &right[k]);
}

/// [`accumulate`] for a whole tile and two panels.
#[inline(always)]
pub(crate) fn add_terms<S: Simd, E: Precision>(
    simd: S,
    tile: &mut [[E; TILE]; TILE],
    left: &[Tile<E, 1>],
    right: &[Tile<E, 1>],
) {
    accumulate_groups(simd, tile, |k| &left[k].0[0], right.len(), |k| &right[k].0[0]);
}

/// The target is meant to be a tile, which stays in the first-level cache while the terms are
/// taken up to four at a time: a plain split has three, rings of mixed tissue a multiple of it.
#[inline(always)]
fn accumulate_groups<'a, S: Simd, E: Precision>(
    simd: S,
    target: &mut [[E; TILE]],
    left: impl Fn(usize) -> &'a [E],
    terms: usize,
    right: impl Fn(usize) -> &'a [E; TILE],
) {
    let mut k = 0;
    while k < terms {
        let rest = terms - k;
        k += match rest.div_ceil(rest.div_ceil(MOST_TERMS)) {
            1 => accumulate_terms::<S, E, 1>(simd, target, &left, &right, k),
            2 => accumulate_terms::<S, E, 2>(simd, target, &left, &right, k),
            3 => accumulate_terms::<S, E, 3>(simd, target, &left, &right, k),
            _ => accumulate_terms::<S, E, MOST_TERMS>(simd, target, &left, &right, k),
        };
    }
}

/// K terms from the first; returns K.
#[inline(always)]
fn accumulate_terms<'a, S: Simd, E: Precision, const K: usize>(
    simd: S,
    target: &mut [[E; TILE]],
    left: &impl Fn(usize) -> &'a [E],
    right: &impl Fn(usize) -> &'a [E; TILE],
    first: usize,
) -> usize {
    let left: [&[E]; K] = std::array::from_fn(|k| left(first + k));
    let right: [&[E; TILE]; K] = std::array::from_fn(|k| right(first + k));
    // Four terms and a row of sums fill 30 of 32 registers where a row is six vectors.
    match size_of::<[E; TILE]>() / size_of::<E::Vector<S>>() {
        6 if S::REGISTER_COUNT >= 32 => in_registers::<S, E, K, 6>(simd, target, &left, &right),
        3 if S::REGISTER_COUNT >= 32 => in_registers::<S, E, K, 3>(simd, target, &left, &right),
        _ => streamed::<S, E, K>(simd, target, &left, &right),
    }
    K
}

/// Four rows at a time, with a vector of the right factors read for all of them.
#[inline(always)]
fn streamed<S: Simd, E: Precision, const K: usize>(
    simd: S,
    target: &mut [[E; TILE]],
    left: &[&[E]; K],
    right: &[&[E; TILE]; K],
) {
    let mut row = 0;
    let (fours, rest) = target.as_chunks_mut::<ROWS>();
    for four in fours {
        accumulate_rows::<S, E, K, ROWS>(simd, four, left, row, right);
        row += ROWS;
    }
    for single in rest.as_chunks_mut::<1>().0 {
        accumulate_rows::<S, E, K, 1>(simd, single, left, row, right);
        row += 1;
    }
}

/// All rows of a tile with the right factors of K terms in registers throughout: rows are read from
/// end to end, each number once, with nothing between a read and the next but K products.
#[inline(always)]
fn in_registers<S: Simd, E: Precision, const K: usize, const V: usize>(
    simd: S,
    target: &mut [[E; TILE]],
    left: &[&[E]; K],
    right: &[&[E; TILE]; K],
) {
    let factors: [[E::Vector<S>; V]; K] =
        std::array::from_fn(|k| E::vectors::<S>(right[k]).as_chunks::<V>().0[0]);
    let count = target.len();
    let left: [&[E]; K] = std::array::from_fn(|k| &left[k][..count]);
    for (row, target) in target.iter_mut().enumerate() {
        let target = &mut E::vectors_mut::<S>(target).as_chunks_mut::<V>().0[0];
        let mut sums = *target;
        for k in 0..K {
            let factor = E::splat(simd, left[k][row]);
            for v in 0..V {
                sums[v] = E::mul_add(simd, factor, factors[k][v], sums[v]);
            }
        }
        *target = sums;
    }
}

#[inline(always)]
fn accumulate_rows<S: Simd, E: Precision, const K: usize, const R: usize>(
    simd: S,
    target: &mut [[E; TILE]; R],
    left: &[&[E]; K],
    row: usize,
    right: &[&[E; TILE]; K],
) {
    let count = size_of::<[E; TILE]>() / size_of::<E::Vector<S>>();
    if S::REGISTER_COUNT >= 32 && count.is_multiple_of(MORE_VECTORS) {
        accumulate_vectors::<S, E, K, R, MORE_VECTORS>(simd, target, left, row, right);
    } else {
        accumulate_vectors::<S, E, K, R, VECTORS>(simd, target, left, row, right);
    }
}

#[inline(always)]
fn accumulate_vectors<S: Simd, E: Precision, const K: usize, const R: usize, const V: usize>(
    simd: S,
    target: &mut [[E; TILE]; R],
    left: &[&[E]; K],
    row: usize,
    right: &[&[E; TILE]; K],
) {
    let rows = target.each_mut().map(|row| E::vectors_mut::<S>(row).as_chunks_mut().0);
    for at in 0..rows[0].len() {
        let mut sums: [[E::Vector<S>; V]; R] = std::array::from_fn(|r| rows[r][at]);
        for k in 0..K {
            let vectors: &[E::Vector<S>; V] = &E::vectors::<S>(right[k]).as_chunks().0[at];
            // Read here, where it is used: held outside of the loop, the factors of all terms
            // would take more registers than there are.
            let factors = &left[k][row..row + R];
            let factors: [E::Vector<S>; R] = std::array::from_fn(|r| E::splat(simd, factors[r]));
            for v in 0..V {
                let vector = vectors[v];
                for r in 0..R {
                    sums[r][v] = E::mul_add(simd, factors[r], vector, sums[r][v]);
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
pub(crate) fn multiply<S: Simd, E: Precision>(
    simd: S,
    tile: &[[E; TILE]; TILE],
    (x, y): (&[E], &mut [f64]),
    mirrored: Option<(&[E], &mut [f64])>,
) {
    let source: [E; TILE] = std::array::from_fn(|j| x[j]);
    let mut sums = [E::default(); TILE];
    let (rows, _) = tile.as_chunks::<ROWS>();
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
fn multiply_rows<S: Simd, E: Precision>(
    simd: S,
    rows: &[[E; TILE]; ROWS],
    source: &[E; TILE],
    factors: [E; ROWS],
    sums: &mut [E; TILE],
) -> [E; ROWS] {
    let rows = rows.each_ref().map(|row| E::vectors::<S>(row));
    let (source, sums) = (E::vectors::<S>(source), E::vectors_mut::<S>(sums));
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
    products.map(|product| sum::<S, E>(product))
}

/// The sum over a vector, by halves.
#[inline(always)]
fn sum<S: Simd, E: Precision>(vector: E::Vector<S>) -> E {
    let mut parts = [E::default(); TILE];
    E::vectors_mut::<S>(&mut parts)[0] = vector;
    let mut count = size_of::<E::Vector<S>>() / size_of::<E>();
    while count > 1 {
        count /= 2;
        for i in 0..count {
            parts[i] = parts[i] + parts[i + count];
        }
    }
    parts[0]
}
