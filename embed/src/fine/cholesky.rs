//! K x = f by a sparse Cholesky factorisation, for meshes of moderate size.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::perm::PermRef;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLdltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, LltRef, SymbolicCholesky, SymbolicCholeskyRaw,
    SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{
    SparseColMat, SparseColMatMut, SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef,
};
use faer::{Conj, Mat, Par, Side};

use super::body::SixFields;
use super::stiffness::FineStiffness;
use crate::error::EmbedError;

/// Finest vertices up to which a factorisation beats conjugate gradients at any ratio of
/// materials: its numbers take half a gigabyte there, and grow with the power 4/3.
pub const DIRECT_VERTICES: usize = 20_000;

impl FineStiffness {
    /// Factors K with the vertices in `order`, solves and refines once.
    pub(super) fn cholesky(
        &self,
        order: &[usize],
        loads: &[SixFields],
    ) -> Result<Vec<SixFields>, EmbedError> {
        let [softest, stiffest] = self.moduli;
        let refused = || EmbedError::FineFactor { rows: 3 * self.vertices(), softest, stiffest };
        let lower = self.lower_half();
        let factor = SparseCholesky::new(&lower, Some(order), 3).ok_or_else(refused)?;
        let solve = |loads: &[SixFields]| {
            let mut x = Mat::from_fn(3 * loads.len(), 6, |i, k| loads[i / 3][(i % 3, k)]);
            factor.solve_in_place(&mut x);
            let six = |v: usize| SixFields::from_fn(|axis, k| x[(3 * v + axis, k)]);
            (0..loads.len()).map(six).collect::<Vec<_>>()
        };
        let mut solution = solve(loads);
        let mut residual = vec![SixFields::zeros(); loads.len()];
        self.apply(&solution, &mut residual);
        for (r, f) in residual.iter_mut().zip(loads) {
            *r = f - *r;
        }
        for (x, correction) in solution.iter_mut().zip(solve(&residual)) {
            *x += correction;
        }
        if solution.iter().any(|x| x.iter().any(|c| !c.is_finite())) {
            return Err(refused());
        }
        Ok(solution)
    }

    /// The lower half of K by columns.
    fn lower_half(&self) -> SparseColMat<usize, f64> {
        let n = 3 * self.vertices();
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for column in 0..n {
            // K is symmetric: the row of blocks is the column.
            for at in self.rows.row(column / 3) {
                let other = self.rows.columns[at] as usize;
                for a in (0..3).filter(|a| 3 * other + a >= column) {
                    rows.push(3 * other + a);
                    values.push(self.rows.blocks[at][(column % 3, a)]);
                }
            }
            starts.push(rows.len());
        }
        SparseColMat::new(SymbolicSparseColMat::new_checked(n, n, starts, None, rows), values)
    }
}

/// P K Pᵀ = L Lᵀ by faer, in one thread: the result must not depend on how many there are.
pub struct SparseCholesky {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl SparseCholesky {
    /// Symbolic and numeric factorisation of the lower half of K, n × n, by approximate minimum
    /// degree unless there is an order of its n / `block` vertices, `block` rows each: the vertex
    /// to be eliminated first comes first.
    ///
    /// None if K is not positive definite, or for want of memory. Cost: O(n²) for a body's K.
    ///
    /// # Panics
    /// If `order` is no permutation of the vertices.
    pub fn new(
        lower: &SparseColMat<usize, f64>,
        order: Option<&[usize]>,
        block: usize,
    ) -> Option<Self> {
        let symbolic = symbolic(lower.symbolic(), order, block)?;
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        symbolic
            .factorize_numeric_llt(
                &mut values,
                lower.as_ref(),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut MemBuffer::try_new(scratch).ok()?),
                Default::default(),
            )
            .ok()?;
        Some(Self { symbolic, values })
    }

    /// Rows of K.
    pub fn rows(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Numbers of L, zeros of supernodes included.
    pub fn numbers(&self) -> usize {
        self.values.len()
    }

    /// X ← K⁻¹ X. Cost: two passes over L a column.
    ///
    /// # Panics
    /// If X has not as many rows as K.
    pub fn solve_in_place(&self, x: &mut Mat<f64>) {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(x.ncols(), Par::Seq);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            x.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }
}

/// P K Pᵀ = L D Lᵀ of a quasi-definite K, [A Bᵀ; B −C] with A and C positive definite in any order of rows, by
/// faer, in one thread. Source: Vanderbei, Symmetric quasidefinite matrices, SIAM J. Optim. 5(1), 1995.
///
/// Factored is S K S, whose largest entry of each row is about 1: pivots are judged apart from how stiff one part of a
/// body is beside another. S has powers of two, which change no digit.
pub struct SparseLdl {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    scale: Vec<f64>,
}

/// Where a [`SparseLdl`] has entries.
pub struct LdlPattern(SymbolicCholesky<usize>);

/// A pivot of S K S below this, or of the wrong sign, is made that large.
const LEAST_PIVOT: f64 = 1e-14;

impl SparseLdl {
    /// Factors the lower half of K, n × n, by approximate minimum degree; `signs` has 1 for the rows of A and
    /// −1 for those of C. Pivots that are none are made small ones of that sign. A `pattern` of L is that of a
    /// factor of a matrix with the same entries. `lower` is S K S afterwards.
    ///
    /// None for want of memory. Cost: as [`SparseCholesky::new`].
    ///
    /// # Panics
    /// If `signs` or `pattern` is of a matrix of another size.
    pub fn new(
        mut lower: SparseColMatMut<'_, usize, f64>,
        signs: &[i8],
        pattern: Option<LdlPattern>,
    ) -> Option<Self> {
        let symbolic = match pattern {
            Some(LdlPattern(symbolic)) => symbolic,
            None => symbolic(lower.symbolic(), None, 1)?,
        };
        let scale = scale(lower.rb());
        let (pattern_of_k, entries) = lower.rb_mut().parts_mut();
        for (column, s) in scale.iter().enumerate() {
            let rows = pattern_of_k.row_idx_of_col_raw(column);
            for (entry, &row) in entries[pattern_of_k.col_range(column)].iter_mut().zip(rows) {
                *entry = s * *entry * scale[row];
            }
        }
        let regular = LdltRegularization {
            dynamic_regularization_signs: Some(signs),
            dynamic_regularization_delta: LEAST_PIVOT,
            dynamic_regularization_epsilon: LEAST_PIVOT,
        };
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        symbolic
            .factorize_numeric_ldlt(
                &mut values,
                lower.rb(),
                Side::Lower,
                regular,
                Par::Seq,
                MemStack::new(&mut MemBuffer::try_new(scratch).ok()?),
                Default::default(),
            )
            .ok()?;
        Some(Self { symbolic, values, scale })
    }

    /// Whether all pivots are those of K: A and C are as definite as they should be.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        let is_own = |pivot: &f64| pivot.abs() > LEAST_PIVOT;
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(columns) => {
                let first = &columns.col_ptr()[..self.scale.len()];
                first.iter().all(|&at| is_own(&self.values[at]))
            }
            SymbolicCholeskyRaw::Supernodal(supernodes) => {
                let factor = SupernodalLdltRef::new(supernodes, &self.values);
                let pivots = |s: usize| factor.supernode(s).val().diagonal().column_vector();
                (0..supernodes.n_supernodes()).all(|s| pivots(s).iter().all(is_own))
            }
        }
    }

    /// The pattern of L, for another matrix with the same entries.
    pub fn into_pattern(self) -> LdlPattern {
        LdlPattern(self.symbolic)
    }

    /// X ← K⁻¹ X. Cost: two passes over L a column.
    ///
    /// # Panics
    /// If X has not as many rows as K.
    pub fn solve_in_place(&self, x: &mut Mat<f64>) {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(x.ncols(), Par::Seq);
        self.multiply(x);
        LdltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            x.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        self.multiply(x);
    }

    /// X ← S X.
    fn multiply(&self, x: &mut Mat<f64>) {
        for column in x.col_iter_mut() {
            column.iter_mut().zip(&self.scale).for_each(|(x, s)| *x *= s);
        }
    }
}

/// S by rows: one over the root of the largest entry of a row, to the next power of two below; 1 for a row of zeros.
fn scale(lower: SparseColMatRef<'_, usize, f64>) -> Vec<f64> {
    let mut largest = vec![0.0f64; lower.ncols()];
    for at in lower.triplet_iter() {
        let size = at.val.abs();
        largest[at.row] = largest[at.row].max(size);
        largest[at.col] = largest[at.col].max(size);
    }
    let power = |size: f64| (-0.5 * size.log2()).floor().exp2();
    largest.into_iter().map(|size| if size > 0.0 { power(size) } else { 1.0 }).collect()
}

/// From how many operations per entry of L on columns are eliminated together, relative to what the library takes for enough:
/// tangents of a few hundred vertices are below that, and take longer column by column.
const SUPERNODAL: SupernodalThreshold = SupernodalThreshold(0.2);

/// The pattern of L.
fn symbolic(
    lower: SymbolicSparseColMatRef<'_, usize>,
    order: Option<&[usize]>,
    block: usize,
) -> Option<SymbolicCholesky<usize>> {
    let permutation = order.map(|order| {
        let forward: Vec<usize> = order.iter().flat_map(|&v| block * v..block * (v + 1)).collect();
        let mut inverse = vec![0; forward.len()];
        forward.iter().enumerate().for_each(|(i, &p)| inverse[p] = i);
        (forward, inverse)
    });
    let ordering = match &permutation {
        Some((forward, inverse)) => {
            SymmetricOrdering::Custom(PermRef::new_checked(forward, inverse, forward.len()))
        }
        None => SymmetricOrdering::Amd,
    };
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SUPERNODAL,
        ..CholeskySymbolicParams::default()
    };
    factorize_symbolic_cholesky(lower, Side::Lower, ordering, parameters).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::sparse::Triplet;

    /// Two bodies of one spring and one pressure each, the second softer by `softness`, tied to each other by as
    /// little as it bears.
    fn pair(softness: f64) -> SparseColMat<usize, f64> {
        let body =
            |at: usize, e: f64| [(at, at, 4.0 * e), (at + 1, at, e), (at + 1, at + 1, -2.0 * e)];
        let tie = [(2, 0, -0.5 * softness)];
        let entries = body(0, 1.0).into_iter().chain(body(2, softness)).chain(tie);
        let entries: Vec<_> = entries.map(|(i, j, v)| Triplet::new(i, j, v)).collect();
        SparseColMat::try_new_from_triplets(4, 4, &entries).unwrap()
    }

    #[test]
    fn soft_pivots_beside_stiff_ones_are_pivots() {
        for softness in [1.0, 1e-9, 1e-18, 1e-27] {
            let factor = SparseLdl::new(pair(softness).rb_mut(), &[1, -1, 1, -1], None).unwrap();
            // K x for x of ones, the second body's in its own units.
            let mut x = Mat::from_fn(4, 1, |i, _| match i {
                0 => 5.0 - 0.5 * softness,
                1 => -1.0,
                2 => 4.5 * softness,
                _ => -softness,
            });
            factor.solve_in_place(&mut x);
            for i in 0..4 {
                assert!((x[(i, 0)] - 1.0).abs() < 1e-14, "{softness}: {x:?}");
            }
        }
    }

    #[test]
    fn pivots_that_are_replaced_are_told_of() {
        let is_exact = |entries: &[(usize, usize, f64)], signs: &[i8]| {
            let n = signs.len();
            let entries: Vec<_> = entries.iter().map(|&(i, j, v)| Triplet::new(i, j, v)).collect();
            let mut k = SparseColMat::try_new_from_triplets(n, n, &entries).unwrap();
            SparseLdl::new(k.rb_mut(), signs, None).is_none_or(|factor| factor.is_exact())
        };
        assert!(SparseLdl::new(pair(1e-9).rb_mut(), &[1, -1, 1, -1], None).unwrap().is_exact());
        // Full enough for supernodes, and not.
        for n in [2, 200] {
            for last in [1.0, -1.0] {
                let mut k: Vec<_> = (0..n).map(|i| (i, i, 2.0 * n as f64)).collect();
                k.extend((0..n).flat_map(|j| (j + 1..n).map(move |i| (i, j, 1.0))));
                k[n - 1].2 *= last;
                assert_eq!(is_exact(&k, &vec![1; n]), last > 0.0, "{n}, {last}");
            }
        }
    }
}
