//! A sparse matrix that is not symmetric, factored.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::{Conj, Mat, Par};

/// P A Q = L U by faer, in one thread: the same bits whatever the machine has.
pub(super) struct SparseLu {
    symbolic: SymbolicLu<usize>,
    numeric: NumericLu<usize, f64>,
}

impl SparseLu {
    /// Factors A, n × n. None where it is singular, or for want of memory.
    pub fn new(matrix: SparseColMatRef<'_, usize, f64>) -> Option<Self> {
        let symbolic = factorize_symbolic_lu(matrix.symbolic(), Default::default()).ok()?;
        let mut numeric = NumericLu::new();
        let scratch = symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
        symbolic
            .factorize_numeric_lu(
                &mut numeric,
                matrix,
                Par::Seq,
                MemStack::new(&mut MemBuffer::try_new(scratch).ok()?),
                Default::default(),
            )
            .ok()?;
        Some(Self { symbolic, numeric })
    }

    /// x ← A⁻¹ x.
    pub fn solve_in_place(&self, x: &mut Mat<f64>) {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(x.ncols(), Par::Seq);
        let stack = &mut MemBuffer::new(scratch);
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            x.as_mut(),
            Par::Seq,
            MemStack::new(stack),
        );
    }
}
