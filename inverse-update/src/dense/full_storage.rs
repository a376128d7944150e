//! What the maintainers that store all of C, both halves, have in common.

use faer::linalg::matmul::matmul;
use faer::{Accum, ColMut, ColRef, Mat, Par};

use crate::InverseError;
use crate::accuracy::{Tally, kept_drift, solve_refined};
use crate::matrix::{SparseStiffness, check_range};

/// u = C f, in one thread: always the same order of summation; refined by `k` where that helps.
pub(crate) fn solve(
    c: &Mat<f64>,
    k: &SparseStiffness,
    f_and_u: (&[f64], &mut [f64]),
    tally: &Tally,
) -> Result<(), InverseError> {
    solve_refined(k, tally, f_and_u, |x| {
        let f = x.to_vec();
        multiply(c, &f, x);
        Ok(())
    })
}

fn multiply(c: &Mat<f64>, f: &[f64], u: &mut [f64]) {
    let u = ColMut::from_slice_mut(u).as_mat_mut();
    matmul(u, Accum::Replace, c, ColRef::from_slice(f).as_mat(), 1.0, Par::Seq);
}

/// The drift of random columns of C.
pub(crate) fn drift(c: &Mat<f64>, k: &SparseStiffness, seed: u64) -> f64 {
    kept_drift(k, seed, |at| Mat::from_fn(c.nrows(), at.len(), |i, j| c[(i, at[j])]))
}

/// The columns of C that belong to `slots`.
pub(crate) fn columns(
    c: &Mat<f64>,
    k: &SparseStiffness,
    slots: &[usize],
) -> Result<Mat<f64>, InverseError> {
    check_range(slots, k.vertices())?;
    let rows = k.rows_of(slots);
    Ok(Mat::from_fn(c.nrows(), rows.len(), |i, j| c[(i, rows[j])]))
}

/// Makes the rows of the first slot wrong by a fraction.
#[cfg(test)]
pub(crate) fn spoil(c: &mut Mat<f64>, fraction: f64) {
    c.get_mut(..3, ..).col_iter_mut().for_each(|mut column| column *= faer::Scale(1.0 + fraction));
}
