//! Sparse rows of small dense blocks, and their products.

use nalgebra::SMatrix;
use rayon::prelude::*;

/// Numbers of a vertex with N unknowns under six loads; an unknown's six lie side by side, so that
/// they share a vector register.
pub(in crate::fine) type Six<const N: usize> = [[f64; 6]; N];

/// Rows per piece of parallel work.
const CHUNK: usize = 512;

/// No block yet.
const NONE: u32 = u32::MAX;

/// A sparse matrix of R×C blocks by rows.
#[derive(Clone)]
pub(in crate::fine) struct BlockRows<const R: usize, const C: usize> {
    pub starts: Vec<usize>,
    pub columns: Vec<u32>,
    pub blocks: Vec<SMatrix<f64, R, C>>,
}

/// y ← y + A x.
pub(super) fn add<const R: usize, const C: usize>(
    y: &mut Six<R>,
    a: &SMatrix<f64, R, C>,
    x: &Six<C>,
) {
    for j in 0..C {
        for i in 0..R {
            let a = a[(i, j)];
            for k in 0..6 {
                y[i][k] += a * x[j][k];
            }
        }
    }
}

impl<const R: usize, const C: usize> BlockRows<R, C> {
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    pub fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// Σ A_ij x_j over some blocks of a row.
    pub fn sum(&self, places: std::ops::Range<usize>, x: &[Six<C>]) -> Six<R> {
        let mut sum = [[0.0; 6]; R];
        for at in places {
            add(&mut sum, &self.blocks[at], &x[self.columns[at] as usize]);
        }
        sum
    }

    /// y ← A x.
    pub fn apply(&self, x: &[Six<C>], y: &mut [Six<R>]) {
        y.par_iter_mut()
            .with_min_len(CHUNK)
            .enumerate()
            .for_each(|(i, y)| *y = self.sum(self.row(i), x));
    }

    /// Rows made side by side: `row` adds blocks, which it may add more than once to a column.
    fn of_rows(
        rows: usize,
        columns: usize,
        row: impl Fn(usize, &mut dyn FnMut(u32, SMatrix<f64, R, C>)) + Sync,
    ) -> Self {
        type Part<const R: usize, const C: usize> = (Vec<usize>, Vec<u32>, Vec<SMatrix<f64, R, C>>);
        let part = |slots: &mut Vec<u32>, chunk: usize| -> Part<R, C> {
            let (mut ends, mut places, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
            for i in chunk * CHUNK..rows.min((chunk + 1) * CHUNK) {
                let first = places.len();
                row(i, &mut |column, block| match slots[column as usize] {
                    NONE => {
                        slots[column as usize] = places.len() as u32;
                        places.push(column);
                        blocks.push(block);
                    }
                    at => blocks[at as usize] += block,
                });
                places[first..].iter().for_each(|&column| slots[column as usize] = NONE);
                ends.push(places.len());
            }
            (ends, places, blocks)
        };
        let parts: Vec<Part<R, C>> = (0..rows.div_ceil(CHUNK))
            .into_par_iter()
            .map_init(|| vec![NONE; columns], part)
            .collect();
        let size = parts.iter().map(|part| part.1.len()).sum();
        let mut starts = vec![0];
        let (mut places, mut blocks) = (Vec::with_capacity(size), Vec::with_capacity(size));
        for (ends, columns, values) in parts {
            starts.extend(ends.iter().map(|end| places.len() + end));
            places.extend(columns);
            blocks.extend(values);
        }
        Self { starts, columns: places, blocks }
    }

    /// A B, where B has so many columns.
    pub fn times<const K: usize>(&self, b: &BlockRows<C, K>, columns: usize) -> BlockRows<R, K> {
        BlockRows::of_rows(self.len(), columns, |i, add| {
            for at in self.row(i) {
                for of in b.row(self.columns[at] as usize) {
                    add(b.columns[of], self.blocks[at] * b.blocks[of]);
                }
            }
        })
    }

    /// Aᵀ B, with the blocks of A by columns.
    pub(super) fn transposed_times<const K: usize>(
        &self,
        by_column: &ByColumn,
        b: &BlockRows<R, K>,
        columns: usize,
    ) -> BlockRows<C, K> {
        BlockRows::of_rows(by_column.starts.len() - 1, columns, |i, add| {
            for &(row, at) in by_column.column(i) {
                let a = self.blocks[at as usize].transpose();
                for of in b.row(row as usize) {
                    add(b.columns[of], a * b.blocks[of]);
                }
            }
        })
    }
}

/// The blocks of a matrix by columns: row and place of each.
pub(super) struct ByColumn {
    starts: Vec<usize>,
    entries: Vec<(u32, u32)>,
}

impl ByColumn {
    pub fn new<const R: usize, const C: usize>(a: &BlockRows<R, C>, columns: usize) -> Self {
        let mut starts = vec![0; columns + 1];
        a.columns.iter().for_each(|&c| starts[c as usize + 1] += 1);
        for c in 0..columns {
            starts[c + 1] += starts[c];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, 0); a.columns.len()];
        for i in 0..a.len() {
            for at in a.row(i) {
                let next = &mut next[a.columns[at] as usize];
                entries[*next] = (i as u32, at as u32);
                *next += 1;
            }
        }
        Self { starts, entries }
    }

    fn column(&self, i: usize) -> &[(u32, u32)] {
        &self.entries[self.starts[i]..self.starts[i + 1]]
    }

    /// Aᵀ x.
    pub fn apply<const R: usize, const C: usize>(
        &self,
        a: &BlockRows<R, C>,
        x: &[Six<R>],
    ) -> Vec<Six<C>> {
        let row = |i: usize| {
            let mut sum = [[0.0; 6]; C];
            for &(row, at) in self.column(i) {
                add(&mut sum, &a.blocks[at as usize].transpose(), &x[row as usize]);
            }
            sum
        };
        (0..self.starts.len() - 1).into_par_iter().with_min_len(CHUNK / 8).map(row).collect()
    }
}
