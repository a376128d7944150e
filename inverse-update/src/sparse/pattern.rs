//! The matrix as a factorisation wants it: one flat copy of the lower half, and its graph.

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
    /// Row-major blocks of the columns up to the diagonal, in the same order.
    pub value_starts: Vec<usize>,
    pub values: Vec<f64>,
}

impl Pattern {
    /// Copies the matrix. Cost: one pass over half of it.
    pub(crate) fn of(k: &SparseStiffness) -> Self {
        let (n, size) = (k.vertices(), k.block() * k.block());
        let stored = k.stored_blocks();
        let mut pattern = Self {
            block: k.block(),
            negative: k.negative(),
            keys: k.order_keys().to_vec(),
            starts: Vec::with_capacity(n + 1),
            columns: Vec::with_capacity(stored),
            value_starts: Vec::with_capacity(n + 1),
            values: Vec::with_capacity((stored + n) / 2 * size),
        };
        for i in 0..n {
            pattern.starts.push(pattern.columns.len());
            pattern.value_starts.push(pattern.values.len() / size);
            let neighbours = k.neighbours(i);
            pattern.columns.extend(neighbours.iter().map(|&j| j as u32));
            let lower = neighbours.partition_point(|&j| j <= i);
            pattern.values.extend_from_slice(&k.row_values(i)[..lower * size]);
        }
        pattern.starts.push(pattern.columns.len());
        pattern.value_starts.push(pattern.values.len() / size);
        pattern
    }

    pub(crate) fn vertices(&self) -> usize {
        self.keys.len()
    }

    /// The vertices that vertex i is coupled to, itself included if it has a block.
    pub(crate) fn neighbours(&self, i: usize) -> &[u32] {
        &self.columns[self.starts[i]..self.starts[i + 1]]
    }

    /// The block that couples i and j, which are neighbours: stored once, so that it may have to
    /// be transposed.
    pub(crate) fn block_at(&self, i: usize, j: usize) -> (&[f64], bool) {
        let (row, column) = (i.max(j), i.min(j));
        let size = self.block * self.block;
        let at = self.neighbours(row).partition_point(|&c| (c as usize) < column);
        let first = size * (self.value_starts[row] + at);
        (&self.values[first..first + size], row != i)
    }

    /// |K_ii| for row `a` of vertex `i`; 0 where nothing is stored.
    pub(crate) fn diagonal(&self, i: usize, a: usize) -> f64 {
        match self.neighbours(i).binary_search(&(i as u32)) {
            Ok(_) => self.block_at(i, i).0[(self.block + 1) * a].abs(),
            Err(_) => 0.0,
        }
    }

    /// K x. Cost: one pass over half of K.
    pub(crate) fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let m = self.block;
        let mut y = vec![0.0; x.len()];
        for i in 0..self.vertices() {
            let lower = &self.values[m * m * self.value_starts[i]..];
            for (&j, block) in self.neighbours(i).iter().zip(lower.chunks_exact(m * m)) {
                let j = j as usize;
                if j > i {
                    break;
                }
                for (at, entry) in block.iter().enumerate() {
                    let (row, column) = (m * i + at / m, m * j + at % m);
                    y[row] += entry * x[column];
                    if j < i {
                        y[column] += entry * x[row];
                    }
                }
            }
        }
        y
    }
}
