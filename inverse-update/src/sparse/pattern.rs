//! The matrix as a factorisation wants it: one flat copy, and its graph.

use crate::matrix::SparseStiffness;

/// A snapshot of K: cheap to take, and another thread can work on it.
#[derive(Debug, Clone)]
pub(crate) struct Pattern {
    pub block: usize,
    pub negative: usize,
    /// The position of each vertex in space, packed; see [`SparseStiffness::set_order_keys`].
    pub keys: Vec<u64>,
    /// Row i has the neighbours `columns[starts[i]..starts[i + 1]]`, itself included, ascending.
    pub starts: Vec<usize>,
    pub columns: Vec<u32>,
    /// Row-major blocks in the same order.
    pub values: Vec<f64>,
}

impl Pattern {
    /// Copies the matrix. Cost: one pass over it.
    pub(crate) fn of(k: &SparseStiffness) -> Self {
        let (n, size) = (k.vertices(), k.block() * k.block());
        let stored = k.stored_blocks();
        let mut pattern = Self {
            block: k.block(),
            negative: k.negative(),
            keys: k.order_keys().to_vec(),
            starts: Vec::with_capacity(n + 1),
            columns: Vec::with_capacity(stored),
            values: Vec::with_capacity(stored * size),
        };
        for i in 0..n {
            pattern.starts.push(pattern.columns.len());
            pattern.columns.extend(k.neighbours(i).iter().map(|&j| j as u32));
            pattern.values.extend_from_slice(k.row_values(i));
        }
        pattern.starts.push(pattern.columns.len());
        pattern
    }

    pub(crate) fn vertices(&self) -> usize {
        self.keys.len()
    }

    /// The vertices that vertex i is coupled to, itself included if it has a block.
    pub(crate) fn neighbours(&self, i: usize) -> &[u32] {
        &self.columns[self.starts[i]..self.starts[i + 1]]
    }

    /// The blocks of row i, of the columns that [`neighbours`](Self::neighbours) tells.
    pub(crate) fn row(&self, i: usize) -> impl Iterator<Item = (usize, &[f64])> {
        let size = self.block * self.block;
        let values = &self.values[size * self.starts[i]..size * self.starts[i + 1]];
        let columns = self.neighbours(i).iter().map(|&j| j as usize);
        columns.zip(values.chunks_exact(size.max(1)))
    }

    /// |K_ii| for row `a` of vertex `i`; 0 where nothing is stored.
    pub(crate) fn diagonal(&self, i: usize, a: usize) -> f64 {
        let own = self.row(i).find(|(j, _)| *j == i);
        own.map_or(0.0, |(_, block)| block[(self.block + 1) * a].abs())
    }

    /// K x. Cost: one pass over K.
    pub(crate) fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let m = self.block;
        let mut y = vec![0.0; x.len()];
        for (i, y) in y.chunks_exact_mut(m.max(1)).enumerate() {
            for (j, block) in self.row(i) {
                for (y, row) in y.iter_mut().zip(block.chunks_exact(m)) {
                    *y += row.iter().zip(&x[m * j..]).map(|(k, x)| k * x).sum::<f64>();
                }
            }
        }
        y
    }
}
