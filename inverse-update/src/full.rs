//! What the maintainers that store all of C, both halves, have in common.

use faer::linalg::matmul::matmul;
use faer::{Accum, ColMut, ColRef, Mat, Par};

use crate::InverseError;
use crate::change::{check_length, check_range, check_vector};

/// u = C f, in one thread: always the same order of summation.
pub(crate) fn multiply(c: &Mat<f64>, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
    check_vector("f", f, c.nrows())?;
    check_length("u", u, c.nrows())?;
    let u = ColMut::from_slice_mut(u).as_mat_mut();
    matmul(u, Accum::Replace, c, ColRef::from_slice(f).as_mat(), 1.0, Par::Seq);
    Ok(())
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
