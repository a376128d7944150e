//! What the maintainers that store all of C, both halves, have in common.

use faer::linalg::matmul::matmul;
use faer::{Accum, ColMut, ColRef, Mat, Par};

use crate::change::{check_length, check_range, check_vector};
use crate::counts::Tally;
use crate::drift::kept_drift;
use crate::residual::refine_once;
use crate::{InverseError, SparseStiffness};

/// u = C f, in one thread: always the same order of summation; refined by `k` where that helps.
pub(crate) fn solve(
    c: &Mat<f64>,
    k: &SparseStiffness,
    (f, u): (&[f64], &mut [f64]),
    tally: &Tally,
) -> Result<(), InverseError> {
    check_vector("f", f, c.nrows())?;
    check_length("u", u, c.nrows())?;
    let mut solution = vec![0.0; f.len()];
    multiply(c, f, &mut solution);
    let refined = refine_once(k, f, &mut solution, |x| {
        let residual = x.to_vec();
        multiply(c, &residual, x);
        Ok(())
    })?;
    tally.refined(usize::from(refined));
    u.copy_from_slice(&solution);
    Ok(())
}

fn multiply(c: &Mat<f64>, f: &[f64], u: &mut [f64]) {
    let u = ColMut::from_slice_mut(u).as_mat_mut();
    matmul(u, Accum::Replace, c, ColRef::from_slice(f).as_mat(), 1.0, Par::Seq);
}

/// The drift of random columns of C.
pub(crate) fn drift(c: &Mat<f64>, k: &SparseStiffness, seed: u64) -> f64 {
    kept_drift(k, seed, |at| Mat::from_fn(c.nrows(), at.len(), |i, j| c[(i, at[j])]))
}

/// The columns of C that belong to `slots` of `block` rows.
pub(crate) fn columns(
    c: &Mat<f64>,
    slots: &[usize],
    block: usize,
) -> Result<Mat<f64>, InverseError> {
    check_range(slots, c.nrows() / block)?;
    let column = |j: usize| block * slots[j / block] + j % block;
    Ok(Mat::from_fn(c.nrows(), block * slots.len(), |i, j| c[(i, column(j))]))
}
