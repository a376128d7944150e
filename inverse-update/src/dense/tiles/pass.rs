//! One read and write of all of C: a signed sum of squares of columns is added to it.

use rayon::prelude::*;

use super::kernel::add_terms;
use super::packed::{Tiles, before};
use super::panel::Panel;
use super::tile::{TILE, Tile};
use crate::dense::precision::Precision;

/// Tiles that a thread takes at a time.
const GROUP: usize = 16;

/// Σ_k s_k y_k y_kᵀ with signs s_k = ±1.
#[derive(Debug, Clone, Default)]
pub(crate) struct SignedPanel {
    pub(crate) columns: Panel,
    pub(crate) signs: Vec<f64>,
}

impl SignedPanel {
    pub(crate) fn none(rows: usize) -> Self {
        Self { columns: Panel::zeros(rows, 0), signs: Vec::new() }
    }

    /// What is added to every diagonal entry.
    pub(crate) fn diagonal(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.columns.rows.div_ceil(TILE) * TILE];
        let width = self.signs.len() * TILE;
        if width > 0 {
            for (sums, block) in sums.chunks_mut(TILE).zip(self.columns.data.chunks(width)) {
                for (y, sign) in block.chunks(TILE).zip(&self.signs) {
                    sums.iter_mut().zip(y).for_each(|(sum, y)| *sum += sign * y * y);
                }
            }
        }
        sums.truncate(self.columns.rows);
        sums
    }

    /// The columns times their signs.
    pub(crate) fn signed(&self) -> Panel {
        let mut signed = self.columns.clone();
        let width = (self.signs.len() * TILE).max(1);
        for block in signed.data.chunks_mut(width) {
            for (y, sign) in block.chunks_mut(TILE).zip(&self.signs) {
                y.iter_mut().for_each(|y| *y *= sign);
            }
        }
        signed
    }

    /// All terms of both.
    pub(crate) fn and(&self, other: &Self) -> Self {
        let signs = self.signs.iter().chain(&other.signs).copied().collect();
        Self { columns: self.columns.beside(&other.columns), signs }
    }
}

impl<E: Precision> Tiles<E> {
    /// C ← C + Σ_k s_k y_k y_kᵀ, every tile read and written once. Cost: O(n²k).
    ///
    /// (s y_i) y_j is (s y_j) y_i to the last bit, so that C stays exactly symmetric; no tile
    /// depends on another, so that threads don't change the result.
    pub(crate) fn add(&mut self, terms: &SignedPanel) {
        let width = terms.signs.len();
        if width == 0 {
            return;
        }
        let pieces = terms.columns.data.as_chunks::<TILE>().0;
        let right: Vec<Tile<E, 1>> = pieces.iter().map(|y| Tile([y.map(E::of)])).collect();
        let signs = terms.signs.iter().cycle();
        let left = pieces.iter().zip(signs).map(|(y, sign)| Tile([y.map(|y| E::of(sign * y))]));
        let left: Vec<Tile<E, 1>> = left.collect();
        let each = |first: usize, tiles: &mut [Tile<E, TILE>]| {
            let (left, right) = (left.as_slice(), right.as_slice());
            pulp::Arch::new().dispatch(Group { first, tiles, left, right, width })
        };
        let is_large = self.is_large();
        let used = before(self.tile_rows());
        let mut diagonal = if is_large {
            let groups = self.data[..used].par_chunks_mut(GROUP).enumerate();
            let parts: Vec<Vec<f64>> =
                groups.map(|(group, tiles)| each(GROUP * group, tiles)).collect();
            parts.concat()
        } else {
            each(0, &mut self.data[..used])
        };
        diagonal.truncate(self.rows);
        self.diagonal = diagonal;
    }
}

/// Consecutive tiles, the first of them by number.
struct Group<'a, E> {
    first: usize,
    tiles: &'a mut [Tile<E, TILE>],
    left: &'a [Tile<E, 1>],
    right: &'a [Tile<E, 1>],
    width: usize,
}

/// Tile row and tile column of a tile by its number.
fn place(number: usize) -> (usize, usize) {
    let i = ((8 * number + 1).isqrt() - 1) / 2;
    (i, number - i * (i + 1) / 2)
}

impl<E: Precision> pulp::WithSimd for Group<'_, E> {
    /// The new diagonals of the tiles on the diagonal, read while these are in the cache.
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> Vec<f64> {
        let (mut i, mut j) = place(self.first);
        let mut diagonal = Vec::new();
        for tile in self.tiles {
            let left = &self.left[i * self.width..(i + 1) * self.width];
            let right = &self.right[j * self.width..(j + 1) * self.width];
            add_terms(simd, &mut tile.0, left, right);
            if j == i {
                diagonal.extend((0..TILE).map(|a| tile.0[a][a].value()));
                (i, j) = (i + 1, 0);
            } else {
                j += 1;
            }
        }
        diagonal
    }
}

#[cfg(test)]
mod tests {
    use super::super::packed::tests::unpack;
    use super::*;
    use faer::Mat;

    #[test]
    fn tiles_are_numbered_by_rows() {
        let places: Vec<_> = (0..6).map(place).collect();
        assert_eq!(places, [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)]);
        let i = 5000;
        assert_eq!([place(i * (i + 1) / 2 - 1), place(i * (i + 1) / 2)], [(i - 1, i - 1), (i, 0)]);
    }

    /// Whole numbers: exact. Every number of terms that has a kernel of its own, and others.
    fn every_term_once<E: Precision>(n: usize) {
        for terms in [0, 1, 2, 3, 6, 7, 9, 12, 13] {
            let y = Mat::from_fn(n, terms, |i, k| ((i * (k + 3)) % 5) as f64 - 2.0);
            let signs: Vec<f64> = (0..terms).map(|k| [1.0, -1.0][k % 2]).collect();
            let terms = SignedPanel { columns: Panel::from_matrix(y.as_ref()), signs };
            let start = Mat::from_fn(n, n, |i, j| ((i + j) % 11) as f64);
            let mut c = Tiles::<E>::from_lower(start.as_ref());
            c.add(&terms);
            let sign = |k: usize| terms.signs[k];
            let signed = Mat::from_fn(n, y.ncols(), |i, k| sign(k) * y[(i, k)]);
            let sum = &signed * y.transpose();
            assert_eq!(terms.diagonal(), (0..n).map(|i| sum[(i, i)]).collect::<Vec<_>>());
            assert_eq!(unpack(&c), start + sum);
        }
    }

    #[test]
    fn one_pass_adds_every_term_once() {
        for n in [1, 48, 101] {
            every_term_once::<f64>(n);
            every_term_once::<f32>(n);
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let n = 1500;
        let columns = Panel::from_matrix(Mat::from_fn(n, 1, |i, _| (i as f64).sin()).as_ref());
        let terms = SignedPanel { columns, signs: vec![-1.0] };
        let result = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let identity = Mat::<f64>::identity(n, n);
                let mut c = Tiles::<f64>::from_lower(identity.as_ref());
                assert_eq!(c.is_large(), threads > 1);
                c.add(&terms);
                c.data
            })
        };
        assert!(result(1) == result(3));
    }
}
