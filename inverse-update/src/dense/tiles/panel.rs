//! A few long columns, stored in blocks of rows as the kernels over tiles want them.

use faer::{Mat, MatRef};

use super::kernel::accumulate;
use super::tile::TILE;

/// An n × k matrix with k small: block after block of [`TILE`] rows, each k × [`TILE`]. Rows
/// beyond n are 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Panel {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) data: Vec<f64>,
}

impl Panel {
    pub(crate) fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, data: vec![0.0; rows.div_ceil(TILE) * TILE * columns] }
    }

    /// A matrix's columns.
    pub(crate) fn from_matrix(matrix: MatRef<'_, f64>) -> Self {
        let mut panel = Self::zeros(matrix.nrows(), matrix.ncols());
        for k in 0..matrix.ncols() {
            for row in 0..matrix.nrows() {
                panel.set(row, k, matrix[(row, k)]);
            }
        }
        panel
    }

    /// All of it as a matrix.
    pub(crate) fn to_matrix(&self) -> Mat<f64> {
        Mat::from_fn(self.rows, self.columns, |row, k| self.get(row, k))
    }

    fn at(&self, row: usize, column: usize) -> usize {
        (row / TILE * self.columns + column) * TILE + row % TILE
    }

    pub(crate) fn get(&self, row: usize, column: usize) -> f64 {
        self.data[self.at(row, column)]
    }

    pub(crate) fn set(&mut self, row: usize, column: usize, value: f64) {
        let at = self.at(row, column);
        self.data[at] = value;
    }

    /// One column in pieces of [`TILE`] rows, the last one with zeros behind its rows.
    pub(crate) fn pieces(&self, column: usize) -> impl Iterator<Item = &[f64; TILE]> {
        let pieces = self.data.as_chunks::<TILE>().0;
        pieces.iter().skip(column).step_by(self.columns)
    }

    /// Some rows, as a matrix of their own.
    pub(crate) fn at_rows(&self, rows: &[usize]) -> Mat<f64> {
        Mat::from_fn(rows.len(), self.columns, |i, k| self.get(rows[i], k))
    }

    /// X ← X + Y M. Cost: O(n k l).
    pub(crate) fn add_times(&mut self, other: &Self, m: MatRef<'_, f64>) {
        let (k, l) = (other.columns, self.columns);
        if k == 0 || l == 0 {
            return;
        }
        let left: Vec<f64> = (0..k * l).map(|at| m[(at / l, at % l)]).collect();
        accumulate_blocks(&mut self.data, &other.data, &left, (k, l));
    }

    /// A range of columns.
    pub(crate) fn some_columns(&self, range: std::ops::Range<usize>) -> Self {
        let mut some = Self::zeros(self.rows, range.len());
        let (wide, narrow) = (self.columns * TILE, range.len() * TILE);
        if narrow > 0 {
            let blocks = some.data.chunks_exact_mut(narrow).zip(self.data.chunks_exact(wide));
            for (target, source) in blocks {
                target.copy_from_slice(&source[range.start * TILE..range.end * TILE]);
            }
        }
        some
    }

    /// X M.
    pub(crate) fn times(&self, m: MatRef<'_, f64>) -> Self {
        let mut product = Self::zeros(self.rows, m.ncols());
        product.add_times(self, m);
        product
    }

    /// Xᵀ Y, in a fixed order. Cost: O(n k l).
    pub(crate) fn inner(&self, other: &Self) -> Mat<f64> {
        let (k, l) = (self.columns, other.columns);
        let mut product = Mat::zeros(k, l);
        if k == 0 || l == 0 {
            return product;
        }
        let blocks = self.data.chunks_exact(k * TILE).zip(other.data.chunks_exact(l * TILE));
        for (x, y) in blocks {
            for (j, y) in y.chunks_exact(TILE).enumerate() {
                for (i, x) in x.chunks_exact(TILE).enumerate() {
                    product[(i, j)] += x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
                }
            }
        }
        product
    }

    /// [X Y].
    pub(crate) fn beside(&self, other: &Self) -> Self {
        let mut both = Self::zeros(self.rows, self.columns + other.columns);
        let width = both.columns * TILE;
        for block in 0..self.rows.div_ceil(TILE) {
            let target = &mut both.data[block * width..(block + 1) * width];
            let (left, right) = target.split_at_mut(self.columns * TILE);
            left.copy_from_slice(&self.data[block * left.len()..(block + 1) * left.len()]);
            right.copy_from_slice(&other.data[block * right.len()..(block + 1) * right.len()]);
        }
        both
    }

    /// Appends rows of 0.
    pub(crate) fn grow(&mut self, more: usize) {
        self.rows += more;
        self.data.resize(self.rows.div_ceil(TILE) * TILE * self.columns, 0.0);
    }

    /// Removes the rows of a slot; the last slot's move into the gap.
    pub(crate) fn swap_remove(&mut self, slot: usize, block: usize) {
        let kept = self.rows - block;
        for a in 0..block {
            for k in 0..self.columns {
                let moved = self.get(kept + a, k);
                self.set(block * slot + a, k, moved);
                self.set(kept + a, k, 0.0);
            }
        }
        self.rows = kept;
        self.data.truncate(kept.div_ceil(TILE) * TILE * self.columns);
    }
}

/// Block by block, target (l × TILE) += leftᵀ (k × l) source (k × TILE).
fn accumulate_blocks(target: &mut [f64], source: &[f64], left: &[f64], (k, l): (usize, usize)) {
    struct Blocks<'a>(&'a mut [f64], &'a [f64], &'a [f64], (usize, usize));
    impl pulp::WithSimd for Blocks<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, simd: S) {
            let Self(target, source, left, (k, l)) = self;
            let blocks = target.chunks_exact_mut(l * TILE).zip(source.chunks_exact(k * TILE));
            for (target, source) in blocks {
                accumulate(simd, target, left, l, source);
            }
        }
    }
    pulp::Arch::new().dispatch(Blocks(target, source, left, (k, l)));
}
