//! A sum of signed rank-one terms, and how it is added to rows of a matrix.

use faer::MatRef;

use crate::packed::LANES;

/// Columns of C handled at a time: this stretch of a row stays in the first-level cache while
/// every group of terms is added to it.
pub(crate) const STRETCH: usize = 512;

/// Σ_k s_k y_k y_kᵀ with signs s_k = ±1: what one pass adds to the matrix.
pub(crate) struct SignedColumns {
    columns: Vec<Vec<f64>>,
    signs: Vec<f64>,
}

impl SignedColumns {
    /// −Y Yᵀ + W Wᵀ for Y `subtracted`, W `added` with equally many rows.
    pub(crate) fn new(subtracted: MatRef<'_, f64>, added: MatRef<'_, f64>) -> Self {
        let mut terms = Self { columns: Vec::new(), signs: Vec::new() };
        for (matrix, sign) in [(subtracted, -1.0), (added, 1.0)] {
            for k in 0..matrix.ncols() {
                terms.columns.push((0..matrix.nrows()).map(|i| matrix[(i, k)]).collect());
                terms.signs.push(sign);
            }
        }
        terms
    }

    /// What is added to the diagonal entry i.
    pub(crate) fn diagonal(&self, i: usize) -> f64 {
        self.columns.iter().zip(&self.signs).map(|(y, sign)| sign * y[i] * y[i]).sum()
    }

    /// Moves as [`PackedSymmetric::swap_remove`] does.
    pub(crate) fn swap_remove(&mut self, slot: usize, block: usize) {
        for column in &mut self.columns {
            let kept = column.len() - block;
            column.copy_within(kept.., block * slot);
            column.truncate(kept);
        }
    }

    /// Adds to R consecutive rows, the first of them row i with its i + 1 entries.
    #[inline(always)]
    pub(crate) fn add_to_rows<const R: usize>(&self, mut rows: [&mut [f64]; R], i: usize) {
        let mut first = 0;
        while first <= i {
            let end = (first + STRETCH).min(i + 1);
            let stretch = rows.each_mut().map(|row| &mut row[first..end]);
            self.add_to_stretch(stretch, i, first);
            first = end;
        }
        // Behind the diagonal of the first row the others go on by 1, 2, … entries.
        for (r, row) in rows.iter_mut().enumerate() {
            for j in i + 1..row.len() {
                row[j] += self.entry(i + r, j);
            }
        }
    }

    fn entry(&self, i: usize, j: usize) -> f64 {
        self.columns.iter().zip(&self.signs).map(|(y, sign)| sign * y[i] * y[j]).sum()
    }

    /// Adds to columns `first..` of rows i, i + 1, …
    #[inline(always)]
    fn add_to_stretch<const R: usize>(&self, mut rows: [&mut [f64]; R], i: usize, first: usize) {
        let mut k = 0;
        // Groups of three: a plain split has exactly three columns, others a multiple of it.
        while k + 3 <= self.columns.len() {
            self.add_group::<R, 3>(&mut rows, i, first, k);
            k += 3;
        }
        while k < self.columns.len() {
            self.add_group::<R, 1>(&mut rows, i, first, k);
            k += 1;
        }
    }

    #[inline(always)]
    fn add_group<const R: usize, const N: usize>(
        &self,
        rows: &mut [&mut [f64]; R],
        i: usize,
        first: usize,
        k: usize,
    ) {
        let factors: [[f64; N]; R] = std::array::from_fn(|r| {
            std::array::from_fn(|g| self.signs[k + g] * self.columns[k + g][i + r])
        });
        let length = rows[0].len();
        let sources: [&[f64]; N] =
            std::array::from_fn(|g| &self.columns[k + g][first..first + length]);
        let chunked = sources.map(|source| source.as_chunks::<LANES>().0);
        let targets = rows.each_mut().map(|row| row.as_chunks_mut::<LANES>().0);
        for at in 0..length / LANES {
            // Copies in local arrays: the compiler sees that nothing overlaps.
            let y: [[f64; LANES]; N] = std::array::from_fn(|g| chunked[g][at]);
            for r in 0..R {
                let mut entries = targets[r][at];
                for g in 0..N {
                    for lane in 0..LANES {
                        entries[lane] += factors[r][g] * y[g][lane];
                    }
                }
                targets[r][at] = entries;
            }
        }
        for j in length - length % LANES..length {
            for r in 0..R {
                for g in 0..N {
                    rows[r][j] += factors[r][g] * sources[g][j];
                }
            }
        }
    }
}
