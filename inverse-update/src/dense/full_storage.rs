//! All of C, both halves, as `paper` and `lu` store it.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

/// C, dense.
pub(super) struct Full(pub(super) Mat<f64>);

impl Default for Full {
    fn default() -> Self {
        Self(Mat::new())
    }
}

impl Full {
    /// C X, column by column and in one thread: always the same order of summation.
    pub(super) fn multiply(&self, x: MatRef<'_, f64>) -> Mat<f64> {
        let mut product = Mat::zeros(x.nrows(), x.ncols());
        for j in 0..x.ncols() {
            let target = product.subcols_mut(j, 1);
            matmul(target, Accum::Replace, &self.0, x.subcols(j, 1), 1.0, Par::Seq);
        }
        product
    }

    pub(super) fn columns(&self, rows: &[usize]) -> Mat<f64> {
        Mat::from_fn(self.0.nrows(), rows.len(), |i, j| self.0[(i, rows[j])])
    }
}
