//! Products with C: of a few of its columns, and of all.

use faer::{Mat, MatRef};
use rayon::prelude::*;

use super::kernel::{accumulate, multiply};
use super::packed::{PARALLEL_FROM, Tiles, before};
use super::panel::Panel;
use super::tile::TILE;
use crate::dense::precision::Precision;

/// Stretches of C whose shares of a product are summed apart, in order: so threads don't change
/// the sum.
const STRETCHES: usize = 8;

impl<E: Precision> Tiles<E> {
    /// C S X, with S the selection of `at`: rows() × k for an r × k matrix X.
    ///
    /// Of every tile row a block of the selected columns is gathered and used while it is in the
    /// cache. Cost: O(n r k); n r numbers are read, half of them a cache line each.
    pub(crate) fn select_times(&self, at: &[usize], x: MatRef<'_, f64>) -> Panel {
        let (r, k) = (at.len(), x.ncols());
        let mut product = Panel::zeros(self.rows, k);
        if r == 0 || k == 0 {
            return product;
        }
        let left: Vec<f64> = (0..r * k).map(|e| x[(e / k, e % k)]).collect();
        let each = |i: usize, target: &mut [f64]| {
            pulp::Arch::new().dispatch(Selected { tiles: self, at, left: &left, i, target });
        };
        let blocks = k * TILE;
        if self.is_large() {
            let targets = product.data.par_chunks_mut(blocks).enumerate();
            targets.with_min_len(8).for_each(|(i, target)| each(i, target));
        } else {
            let targets = product.data.chunks_mut(blocks).enumerate();
            targets.for_each(|(i, target)| each(i, target));
        }
        product
    }

    /// The columns of C at these rows, rows() × `at.len()`.
    pub(crate) fn gather(&self, at: &[usize]) -> Mat<f64> {
        let mut columns = Mat::zeros(self.rows, at.len());
        for (k, &j) in at.iter().enumerate() {
            for (i, piece) in columns.col_as_slice_mut(k).chunks_mut(TILE).enumerate() {
                self.read_column(i, j, piece);
            }
        }
        columns
    }

    /// C on these rows and columns.
    pub(crate) fn submatrix(&self, at: &[usize]) -> Mat<f64> {
        Mat::from_fn(at.len(), at.len(), |i, j| self.get(at[i], at[j]).value())
    }

    /// Rows of block `i` of column `j`.
    #[inline(always)]
    fn read_column(&self, i: usize, j: usize, target: &mut [f64]) {
        let (block, inner) = (j / TILE, j % TILE);
        if block < i {
            let tile = &self.data[before(i) + block].0;
            target.iter_mut().zip(tile).for_each(|(t, row)| *t = row[inner].value());
        } else {
            let row = &self.data[before(block) + i].0[inner];
            target.iter_mut().zip(row).for_each(|(t, entry)| *t = entry.value());
        }
    }

    /// C F for a panel F; every stored entry is read once. Cost: O(n²k).
    ///
    /// Sums over a tile are in the stored scalar, all others in f64, in a fixed order.
    pub(crate) fn multiply(&self, f: &Panel) -> Panel {
        let source: Vec<E> = f.data.iter().map(|&x| E::of(x)).collect();
        let share = |stretch: &[usize; 2]| {
            let mut share = Panel::zeros(self.rows, f.columns);
            let (source, target) = (source.as_slice(), share.data.as_mut_slice());
            let width = TILE * f.columns;
            pulp::Arch::new().dispatch(Stretch {
                tiles: self,
                of: *stretch,
                source,
                target,
                width,
            });
            share
        };
        if !self.is_stretched() {
            return share(&[0, self.tile_rows()]);
        }
        let stretches = self.stretches();
        let shares: Vec<Panel> = if self.is_large() {
            stretches.par_iter().map(share).collect()
        } else {
            stretches.iter().map(share).collect()
        };
        let mut sum = Panel::zeros(self.rows, f.columns);
        for share in &shares {
            sum.data.iter_mut().zip(&share.data).for_each(|(sum, x)| *sum += x);
        }
        sum
    }

    /// By size alone, never by threads.
    fn is_stretched(&self) -> bool {
        self.bytes() >= PARALLEL_FROM
    }

    /// Ranges of tile rows with about equally many tiles.
    fn stretches(&self) -> Vec<[usize; 2]> {
        let (rows, all) = (self.tile_rows(), before(self.tile_rows()));
        let end = |part: usize| (0..=rows).find(|&i| before(i) * STRETCHES >= part * all);
        let ends: Vec<usize> = (0..=STRETCHES).map(|part| end(part).unwrap_or(rows)).collect();
        ends.windows(2).map(|ends| [ends[0], ends[1]]).collect()
    }
}

/// Block `i` of C S X.
struct Selected<'a, E> {
    tiles: &'a Tiles<E>,
    at: &'a [usize],
    left: &'a [f64],
    i: usize,
    target: &'a mut [f64],
}

impl<E: Precision> pulp::WithSimd for Selected<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let mut gathered = vec![0.0; self.at.len() * TILE];
        for (&j, target) in self.at.iter().zip(gathered.as_chunks_mut::<TILE>().0) {
            self.tiles.read_column(self.i, j, target);
        }
        let stride = self.target.len() / TILE;
        accumulate(simd, self.target, self.left, stride, &gathered);
    }
}

/// What some tile rows and their mirror image add to C F.
struct Stretch<'a, E> {
    tiles: &'a Tiles<E>,
    of: [usize; 2],
    source: &'a [E],
    target: &'a mut [f64],
    width: usize,
}

impl<E: Precision> pulp::WithSimd for Stretch<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let width = self.width;
        for i in self.of[0]..self.of[1] {
            let (above, own) = self.target[..(i + 1) * width].split_at_mut(i * width);
            let w = &self.source[i * width..(i + 1) * width];
            for j in 0..=i {
                let tile = &self.tiles.data[before(i) + j].0;
                let x = &self.source[j * width..(j + 1) * width];
                for k in (0..width).step_by(TILE) {
                    let straight = (&x[k..k + TILE], &mut own[k..k + TILE]);
                    let mirrored =
                        (j < i).then(|| (&w[k..k + TILE], &mut above[j * width + k..][..TILE]));
                    multiply(simd, tile, straight, mirrored);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::packed::tests::numbered;
    use super::*;

    fn panel(matrix: &Mat<f64>) -> Panel {
        Panel::from_matrix(matrix.as_ref())
    }

    fn products<E: Precision>(n: usize) {
        // Small whole numbers: exact in f32 too.
        let whole = Mat::from_fn(n, n, |i, j| ((i + j) * (i + 1) * (j + 1) % 7) as f64);
        let c = Tiles::<E>::from_lower(whole.as_ref());
        let f = Mat::from_fn(n, 5, |i, k| ((i + k) % 4) as f64 - 1.0);
        assert_eq!(c.multiply(&panel(&f)), panel(&(&whole * &f)));
        let at: Vec<usize> = [0, n - 1, n / 2, n / 3].into_iter().filter(|&j| j < n).collect();
        let x = Mat::from_fn(at.len(), 7, |i, k| (i + 2 * k) as f64);
        let selected = Mat::from_fn(n, at.len(), |i, j| whole[(i, at[j])]);
        assert_eq!(c.gather(&at), selected);
        assert_eq!(c.select_times(&at, x.as_ref()), panel(&(selected * x)));
    }

    #[test]
    fn products_are_the_dense_ones() {
        for n in [1, 30, 48, 149] {
            products::<f64>(n);
            products::<f32>(n);
        }
        // Large enough for stretches and threads.
        products::<f64>(1500);
    }

    #[test]
    fn stretches_cover_every_tile_row_once() {
        for n in [1, 49, 700] {
            let c = Tiles::<f64>::from_lower(numbered(n).as_ref());
            let rows: Vec<usize> = c.stretches().iter().flat_map(|s| s[0]..s[1]).collect();
            assert_eq!(rows, (0..n.div_ceil(TILE)).collect::<Vec<_>>());
        }
    }

    #[test]
    fn nothing_selected_is_zero() {
        let c = Tiles::<f64>::from_lower(numbered(3).as_ref());
        let none = c.select_times(&[], Mat::<f64>::zeros(0, 2).as_ref());
        assert_eq!(none, Panel::zeros(3, 2));
    }
}
