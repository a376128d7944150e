//! Direct methods: what a user without an updated inverse does after every change of K.

use std::time::Instant;

use faer::linalg::solvers::{DenseSolveCore, PartialPivLu, Solve};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Mat, Par, Side, get_global_parallelism, set_global_parallelism};
use yawara_embed::SparseCholesky;
use yawara_inverse_update::{SparseStiffness, elimination_order};

use crate::error::{BenchError, Result};
use crate::harness::statistics::milliseconds_since;

/// A direct method of faer, in one thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direct {
    /// Dense LU with partial pivoting, and the inverse.
    Lu,
    /// Dense LLᵀ, and the inverse.
    Cholesky,
    /// Sparse LLᵀ after approximate minimum degree: ordering, symbolic and numeric part.
    SparseAmd,
    /// Sparse LLᵀ after the nested dissection of the maintainer `sparse`.
    SparseDissection,
}

/// All of them, the reference first.
pub const DIRECT: [Direct; 4] =
    [Direct::Lu, Direct::Cholesky, Direct::SparseAmd, Direct::SparseDissection];

/// What solves K u = f after a [`Direct`] method is done.
pub(crate) enum Solver {
    /// C, both halves.
    Inverse(Mat<f64>),
    /// L and U, dense.
    Lu(PartialPivLu<f64>),
    /// L, sparse.
    Cholesky(Box<SparseCholesky>),
}

impl Direct {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lu => "lu",
            Self::Cholesky => "cholesky",
            Self::SparseAmd => "sparse_refactor_amd",
            Self::SparseDissection => "sparse_refactor_nd",
        }
    }

    /// True if it holds n² numbers.
    pub fn is_dense(self) -> bool {
        matches!(self, Self::Lu | Self::Cholesky)
    }

    /// Starts from K alone. Returns the solver and the time in ms, which the copy of K into the
    /// library's own format is no part of.
    pub(crate) fn rebuild(self, k: &SparseStiffness) -> Result<(Solver, f64)> {
        let (method, rows) = (self.name(), k.dofs());
        let not_factored = || BenchError::NotFactored(method, rows);
        if self.is_dense() {
            let dense = k.to_dense();
            let begin = Instant::now();
            let inverse = match self {
                Self::Lu => dense.partial_piv_lu().inverse(),
                _ => dense.llt(Side::Lower).map_err(|_| not_factored())?.inverse(),
            };
            return Ok((Solver::Inverse(inverse), milliseconds_since(begin)));
        }
        let lower = lower_half(k);
        let begin = Instant::now();
        let order = (self == Self::SparseDissection).then(|| elimination_order(k));
        let factor = SparseCholesky::new(&lower, order.as_deref(), k.block());
        let elapsed = milliseconds_since(begin);
        Ok((Solver::Cholesky(Box::new(factor.ok_or_else(not_factored)?)), elapsed))
    }
}

/// Runs `work` with faer's dense routines in one thread, as the updates run.
pub(crate) fn in_one_thread<T>(work: impl FnOnce() -> T) -> T {
    let before = get_global_parallelism();
    set_global_parallelism(Par::Seq);
    let result = work();
    set_global_parallelism(before);
    result
}

impl Solver {
    /// u = K⁻¹ f.
    pub fn solve(&self, f: &[f64]) -> Vec<f64> {
        let mut u = Mat::from_fn(f.len(), 1, |i, _| f[i]);
        self.solve_in_place(&mut u);
        u.col_as_slice(0).to_vec()
    }

    /// The columns of C that belong to `slots` of 3 rows.
    pub fn columns(&self, slots: &[usize]) -> Mat<f64> {
        let column = |j: usize| 3 * slots[j / 3] + j % 3;
        let rows = match self {
            Self::Inverse(c) => {
                return Mat::from_fn(c.nrows(), 3 * slots.len(), |i, j| c[(i, column(j))]);
            }
            Self::Lu(factor) => factor.L().nrows(),
            Self::Cholesky(factor) => factor.rows(),
        };
        let mut columns = Mat::from_fn(rows, 3 * slots.len(), |i, j| f64::from(i == column(j)));
        self.solve_in_place(&mut columns);
        columns
    }

    fn solve_in_place(&self, u: &mut Mat<f64>) {
        match self {
            Self::Inverse(c) => *u = c * &*u,
            Self::Lu(factor) => factor.solve_in_place(u),
            Self::Cholesky(factor) => factor.solve_in_place(u),
        }
    }
}

/// The lower half of K by columns, as faer's factorisations read it.
pub(crate) fn lower_half(k: &SparseStiffness) -> SparseColMat<usize, f64> {
    let (block, n) = (k.block(), k.dofs());
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for column in 0..n {
        let (slot, b) = (column / block, column % block);
        for &other in k.neighbours(slot).iter().filter(|&&other| other >= slot) {
            // K is symmetric to the last bit: row-major blocks of this row are columns.
            let Some(value) = k.block_at(slot, other) else { continue };
            for a in (0..block).filter(|a| block * other + a >= column) {
                rows.push(block * other + a);
                values.push(value[block * b + a]);
            }
        }
        starts.push(rows.len());
    }
    SparseColMat::new(SymbolicSparseColMat::new_checked(n, n, starts, None, rows), values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::organ::{Organ, Size};
    use crate::workloads::history::History;

    fn stiffness() -> SparseStiffness {
        let organ = Organ::new(Size::Quick).unwrap();
        History::refined(&organ, "linear", 400, 0, 1).unwrap().stiffness().unwrap()
    }

    #[test]
    fn all_methods_solve_what_they_were_given() {
        let k = stiffness();
        let u: Vec<f64> = (0..k.dofs()).map(|i| (i as f64).sin()).collect();
        let mut f = vec![0.0; k.dofs()];
        k.apply(&u, &mut f).unwrap();
        for method in DIRECT {
            let (solver, milliseconds) = method.rebuild(&k).unwrap();
            assert!(milliseconds > 0.0);
            let difference =
                solver.solve(&f).iter().zip(&u).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            // cond(K) of this body is about 1e5.
            assert!(difference.sqrt() < 1e-8, "{}: {difference:e}", method.name());
            let columns = solver.columns(&[7, 3]);
            assert_eq!((columns.nrows(), columns.ncols()), (k.dofs(), 6));
            let mut unit = vec![0.0; k.dofs()];
            k.apply(columns.col_as_slice(4), &mut unit).unwrap();
            unit[3 * 3 + 1] -= 1.0;
            let worst = unit.iter().fold(0.0, |worst: f64, x| worst.max(x.abs()));
            assert!(worst < 1e-8, "{}: {worst:e}", method.name());
        }
    }

    #[test]
    fn the_dissection_fills_in_as_little_as_minimum_degree() {
        let k = stiffness();
        let lower = lower_half(&k);
        let order = elimination_order(&k);
        let reversed: Vec<usize> = order.iter().rev().copied().collect();
        let numbers = |order| SparseCholesky::new(&lower, order, 3).unwrap().numbers();
        let (degree, dissection) = (numbers(None), numbers(Some(&order)));
        assert!(dissection < degree * 3 / 2, "{dissection} against {degree}");
        // Separators first: the order would have been read backwards.
        assert!(numbers(Some(&reversed)) > 2 * dissection);
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused() {
        let mut k = SparseStiffness::zeros(1, 3).unwrap();
        k.add(&[0], Mat::from_fn(3, 3, |i, j| if i == j { -1.0 } else { 0.0 }).as_ref()).unwrap();
        for method in [Direct::Cholesky, Direct::SparseAmd, Direct::SparseDissection] {
            let error = method.rebuild(&k).err().unwrap();
            assert!(matches!(error, BenchError::NotFactored(..)), "{error}");
        }
    }
}
