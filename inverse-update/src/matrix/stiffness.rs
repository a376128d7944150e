//! The stiffness matrix itself, sparse: for residuals, and to rebuild an inverse from.

use std::sync::Arc;

use faer::{Mat, MatRef};

use super::checks::{check_length, check_matrix, check_slots, check_symmetry, check_vector};
use crate::InverseError;

/// A block that has cancelled to this fraction of what was subtracted holds rounding alone.
///
/// The comparison is with the same block's own operands, never with other entries: a real
/// coupling below it has been rounded away by the subtraction itself, at any ratio of moduli.
pub(super) const CANCELLED: f64 = 16.0 * f64::EPSILON;

/// A symmetric matrix of square blocks, stored by block rows; both halves are held and equal
/// to the last bit.
///
/// Vertices are slots `0..vertices()`, each of `block()` rows. The matrix is meant to be positive
/// definite, or symmetric quasi-definite if the last `negative()` rows of every vertex (a pressure)
/// bear pivots below 0. Every vertex may carry a place, its order key. Units: N/m.
#[derive(Debug, Clone)]
pub struct SparseStiffness {
    block: usize,
    negative: usize,
    /// A copy of the matrix shares them until one of both changes them.
    pub(super) rows: Vec<Arc<BlockRow>>,
    order_keys: Vec<u64>,
    updates_at_once: usize,
}

/// One block row: columns ascending, `values` one row-major block per column.
#[derive(Debug, Clone, Default)]
pub(super) struct BlockRow {
    pub columns: Vec<usize>,
    pub values: Vec<f64>,
}

impl BlockRow {
    fn get(&self, column: usize, size: usize) -> Option<&[f64]> {
        let at = self.columns.binary_search(&column).ok()?;
        Some(&self.values[at * size..(at + 1) * size])
    }

    pub fn remove(&mut self, column: usize, size: usize) -> Option<Vec<f64>> {
        let at = self.columns.binary_search(&column).ok()?;
        self.columns.remove(at);
        Some(self.values.drain(at * size..(at + 1) * size).collect())
    }

    pub fn set(&mut self, column: usize, value: &[f64]) {
        let size = value.len();
        match self.columns.binary_search(&column) {
            Ok(at) => self.values[at * size..(at + 1) * size].copy_from_slice(value),
            Err(at) => {
                self.columns.insert(at, column);
                self.values.splice(at * size..at * size, value.iter().copied());
            }
        }
    }
}

/// What a split is about to change of K.
#[derive(Debug)]
pub(crate) struct RowsBefore {
    vertices: usize,
    rows: Vec<(usize, Arc<BlockRow>)>,
}

impl SparseStiffness {
    /// The zero matrix of `vertices` blocks of `block` rows.
    /// # Errors
    /// [`InverseError::EmptyBlock`] if `block` is 0.
    pub fn zeros(vertices: usize, block: usize) -> Result<Self, InverseError> {
        Self::quasi_definite(vertices, block, 0)
    }

    /// The zero matrix of a quasi-definite system [A, Bᵀ; B, −P], A and P positive definite: the
    /// last `negative` of the `block` rows of every vertex belong to −P.
    ///
    /// Its LDLᵀ exists in any order, with `negative` pivots below 0 per vertex.
    /// # Errors
    /// [`InverseError::EmptyBlock`] if `block` is 0; [`InverseError::Shape`] if `negative` exceeds
    /// it.
    /// # Source
    /// Vanderbei, Symmetric quasidefinite matrices, SIAM J. Optimization 5(1), 1995.
    pub fn quasi_definite(
        vertices: usize,
        block: usize,
        negative: usize,
    ) -> Result<Self, InverseError> {
        if block == 0 {
            return Err(InverseError::EmptyBlock);
        }
        if negative > block {
            let what = "the negative part of a block";
            return Err(InverseError::Shape { what, want: (block, block), got: (negative, block) });
        }
        let rows = vec![Arc::default(); vertices];
        let order_keys = vec![0; vertices];
        Ok(Self { block, negative, rows, order_keys, updates_at_once: 0 })
    }

    /// Sets the positions of the vertices: a lattice point each, packed 3 × 21 bits with x lowest.
    ///
    /// A hint for elimination orders; results don't depend on it beyond rounding. Without it all
    /// keys are 0. A vertex that is added later has its own, [`RingChange::order_key`].
    /// # Errors
    /// [`InverseError::Shape`] unless there is one key per vertex.
    ///
    /// [`RingChange::order_key`]: crate::RingChange::order_key
    pub fn set_order_keys(&mut self, keys: &[u64]) -> Result<(), InverseError> {
        if keys.len() != self.vertices() {
            let (want, got) = ((self.vertices(), 1), (keys.len(), 1));
            return Err(InverseError::Shape { what: "the order keys", want, got });
        }
        self.order_keys.copy_from_slice(keys);
        Ok(())
    }

    /// The place of every vertex, by slot; see [`set_order_keys`](Self::set_order_keys).
    #[must_use]
    pub fn order_keys(&self) -> &[u64] {
        &self.order_keys
    }

    /// Tells how many updates may come in a batch, 0 for not known: which maintainer is the fastest depends on it.
    pub fn expect_updates(&mut self, at_once: usize) {
        self.updates_at_once = at_once;
    }

    /// See [`expect_updates`](Self::expect_updates).
    #[must_use]
    pub fn updates_at_once(&self) -> usize {
        self.updates_at_once
    }

    /// Rows at the end of every block whose pivots are negative; 0 for a positive definite matrix.
    #[must_use]
    pub fn negative(&self) -> usize {
        self.negative
    }

    /// The sign of row j's pivot: −1 in the last [`negative`](Self::negative) rows of every vertex.
    pub(crate) fn sign(&self, j: usize) -> f64 {
        if j % self.block + self.negative < self.block { 1.0 } else { -1.0 }
    }

    /// Vertices now held.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.rows.len()
    }

    /// Rows per vertex: 3 displacements, 4 with a pressure.
    #[must_use]
    pub fn block(&self) -> usize {
        self.block
    }

    /// Rows of the whole matrix, `block() · vertices()`.
    #[must_use]
    pub fn dofs(&self) -> usize {
        self.block * self.rows.len()
    }

    /// A row to change.
    pub(super) fn row_mut(&mut self, slot: usize) -> &mut BlockRow {
        Arc::make_mut(&mut self.rows[slot])
    }

    /// The rows of some vertices, in their order.
    pub(crate) fn rows_of(&self, slots: &[usize]) -> Vec<usize> {
        slots.iter().flat_map(|&slot| self.block * slot..self.block * (slot + 1)).collect()
    }

    /// Columns of the identity by row number.
    pub(crate) fn unit_columns(&self, rows: &[usize]) -> Mat<f64> {
        Mat::from_fn(self.dofs(), rows.len(), |i, j| if i == rows[j] { 1.0 } else { 0.0 })
    }

    /// Whether loads have as many rows as the matrix, all of them finite.
    pub(crate) fn check_loads(&self, loads: MatRef<'_, f64>) -> Result<(), InverseError> {
        check_matrix("loads", loads, (self.dofs(), loads.ncols()))
    }

    /// Blocks stored, both halves and the diagonal.
    #[must_use]
    pub fn stored_blocks(&self) -> usize {
        self.rows.iter().map(|row| row.columns.len()).sum()
    }

    /// Adds a dense matrix on the rows of `slots`: K ← K + S A Sᵀ with S the selection.
    ///
    /// Shapes: `dense` (block·slots) square, symmetric. Cost: O(slots²) blocks.
    /// # Errors
    /// [`InverseError`] on wrong slots, shape, a NaN, an infinity, an asymmetry or an overflow;
    /// K is then unchanged.
    pub fn add(&mut self, slots: &[usize], dense: MatRef<'_, f64>) -> Result<(), InverseError> {
        check_slots(slots, self.vertices())?;
        let rows = self.block * slots.len();
        check_matrix("the matrix to add", dense, (rows, rows))?;
        check_symmetry("the matrix to add", dense)?;
        let none = Mat::<f64>::zeros(rows, rows);
        self.check_replace(slots, none.as_ref(), dense)?;
        self.replace(slots, none.as_ref(), dense);
        Ok(())
    }

    /// f = K u, both of length `dofs()`. Cost: O(stored entries).
    /// # Errors
    /// [`InverseError::Shape`], [`InverseError::NotFinite`].
    pub fn apply(&self, u: &[f64], f: &mut [f64]) -> Result<(), InverseError> {
        check_vector("u", u, self.dofs())?;
        check_length("f", f, self.dofs())?;
        self.sum_products(u, f, |product| product);
        Ok(())
    }

    /// f = |K| |u|, entry by entry: what rounding in K u is relative to.
    pub(crate) fn apply_absolute(&self, u: &[f64], f: &mut [f64]) {
        self.sum_products(u, f, f64::abs);
    }

    /// f_i = Σ_j `term`(K_ij u_j), in the order of the columns.
    #[inline(always)]
    fn sum_products(&self, u: &[f64], f: &mut [f64], term: impl Fn(f64) -> f64) {
        let m = self.block;
        for (row, target) in self.rows.iter().zip(f.chunks_exact_mut(m)) {
            target.fill(0.0);
            for (&column, value) in row.columns.iter().zip(row.values.chunks_exact(m * m)) {
                let source = &u[m * column..m * (column + 1)];
                for (sum, entries) in target.iter_mut().zip(value.chunks_exact(m)) {
                    for (a, x) in entries.iter().zip(source) {
                        *sum += term(a * x);
                    }
                }
            }
        }
    }

    /// The whole matrix, `dofs()` × `dofs()`.
    #[must_use]
    pub fn to_dense(&self) -> Mat<f64> {
        let m = self.block;
        let mut dense = Mat::zeros(self.dofs(), self.dofs());
        for (i, row) in self.rows.iter().enumerate() {
            for (&j, value) in row.columns.iter().zip(row.values.chunks_exact(m * m)) {
                for (e, &entry) in value.iter().enumerate() {
                    dense[(m * i + e / m, m * j + e % m)] = entry;
                }
            }
        }
        dense
    }

    /// The block that couples slots `i` and `j`, row-major, `None` where nothing is stored.
    #[must_use]
    pub fn block_at(&self, i: usize, j: usize) -> Option<&[f64]> {
        self.rows.get(i)?.get(j, self.block * self.block)
    }

    /// The slots that slot `i` is coupled to, itself included, ascending; empty where `i` is
    /// not a slot.
    #[must_use]
    pub fn neighbours(&self, i: usize) -> &[usize] {
        self.rows.get(i).map_or(&[], |row| &*row.columns)
    }

    /// The blocks of row `i` in the order of its neighbours, row-major; none where `i` is no slot.
    pub(crate) fn row_values(&self, i: usize) -> &[f64] {
        self.rows.get(i).map_or(&[], |row| &*row.values)
    }

    /// K_jj of row j in `0..dofs()`; 0 where nothing is stored.
    #[must_use]
    pub fn diagonal(&self, j: usize) -> f64 {
        let (slot, inner) = (j / self.block, j % self.block);
        self.block_at(slot, slot).map_or(0.0, |value| value[inner * (self.block + 1)])
    }

    /// Fails if K − S `minus` Sᵀ + S `plus` Sᵀ would overflow.
    pub(crate) fn check_replace(
        &self,
        slots: &[usize],
        minus: MatRef<'_, f64>,
        plus: MatRef<'_, f64>,
    ) -> Result<(), InverseError> {
        let m = self.block;
        let mut value = vec![0.0; m * m];
        for (p, q) in pairs(slots.len()) {
            self.replaced(slots, (p, q), (minus, plus), &mut value);
            if let Some(at) = value.iter().position(|x| !x.is_finite()) {
                let (row, col) = (m * slots[p] + at / m, m * slots[q] + at % m);
                let what = "the changed stiffness";
                return Err(InverseError::NotFinite { what, row, col, value: value[at] });
            }
        }
        Ok(())
    }

    /// K ← K − S `minus` Sᵀ + S `plus` Sᵀ on checked data, symmetrised.
    pub(crate) fn replace(
        &mut self,
        slots: &[usize],
        minus: MatRef<'_, f64>,
        plus: MatRef<'_, f64>,
    ) {
        let m = self.block;
        let (mut value, mut mirrored) = (vec![0.0; m * m], vec![0.0; m * m]);
        for (p, q) in pairs(slots.len()) {
            let scale = self.replaced(slots, (p, q), (minus, plus), &mut value);
            let largest = value.iter().fold(0.0, |worst: f64, x| worst.max(x.abs()));
            if p != q && largest <= CANCELLED * scale {
                self.row_mut(slots[p]).remove(slots[q], value.len());
                self.row_mut(slots[q]).remove(slots[p], value.len());
                continue;
            }
            self.row_mut(slots[p]).set(slots[q], &value);
            if p != q {
                for (e, entry) in mirrored.iter_mut().enumerate() {
                    *entry = value[m * (e % m) + e / m];
                }
                self.row_mut(slots[q]).set(slots[p], &mirrored);
            }
        }
    }

    /// Writes the new block (p, q) of the ring; returns the largest operand that it was made of.
    fn replaced(
        &self,
        slots: &[usize],
        (p, q): (usize, usize),
        (minus, plus): (MatRef<'_, f64>, MatRef<'_, f64>),
        value: &mut [f64],
    ) -> f64 {
        let m = self.block;
        let old = self.block_at(slots[p], slots[q]);
        let mut scale: f64 = 0.0;
        for a in 0..m {
            for b in 0..m {
                let (i, j) = (m * p + a, m * q + b);
                let before = old.map_or(0.0, |entries| entries[m * a + b]);
                // Halves are added after the division: their sum can't overflow then.
                let out = 0.5 * minus[(i, j)] + 0.5 * minus[(j, i)];
                let entry = 0.5 * plus[(i, j)] + 0.5 * plus[(j, i)];
                scale = scale.max(before.abs()).max(out.abs()).max(entry.abs());
                value[m * a + b] = (before - out) + entry;
            }
        }
        scale
    }

    /// Appends one vertex: its coupling to `slots` (r × m), its own block (m × m) and its place.
    pub(crate) fn append(
        &mut self,
        slots: &[usize],
        coupling: MatRef<'_, f64>,
        own: MatRef<'_, f64>,
        order_key: u64,
    ) {
        let m = self.block;
        let new = self.rows.len();
        self.order_keys.push(order_key);
        self.rows.push(Arc::default());
        let mut value = vec![0.0; m * m];
        for (p, &slot) in slots.iter().enumerate() {
            for (e, entry) in value.iter_mut().enumerate() {
                *entry = coupling[(m * p + e / m, e % m)];
            }
            if value.iter().all(|&x| x == 0.0) {
                continue;
            }
            self.row_mut(slot).set(new, &value);
            let transposed: Vec<f64> = (0..m * m).map(|e| value[m * (e % m) + e / m]).collect();
            self.row_mut(new).set(slot, &transposed);
        }
        for (e, entry) in value.iter_mut().enumerate() {
            *entry = 0.5 * own[(e / m, e % m)] + 0.5 * own[(e % m, e / m)];
        }
        self.row_mut(new).set(new, &value);
    }

    /// The rows that a split on `slots` changes, as they are.
    pub(crate) fn rows_before(&self, slots: &[usize]) -> RowsBefore {
        let rows = slots.iter().map(|&slot| (slot, Arc::clone(&self.rows[slot]))).collect();
        RowsBefore { vertices: self.vertices(), rows }
    }

    /// Takes splits back, the last one first: K is as it was to the last bit.
    pub(crate) fn restore(&mut self, before: RowsBefore) {
        self.rows.truncate(before.vertices);
        self.order_keys.truncate(before.vertices);
        for (slot, row) in before.rows {
            self.rows[slot] = row;
        }
    }

    /// Removes a vertex and moves the last one into its slot, as `Vec::swap_remove`.
    pub(crate) fn swap_remove(&mut self, slot: usize) {
        let size = self.block * self.block;
        let gone = std::mem::take(&mut self.rows[slot]);
        for &column in &gone.columns {
            if column != slot {
                self.row_mut(column).remove(slot, size);
            }
        }
        let last = self.rows.len() - 1;
        self.rows.swap_remove(slot);
        self.order_keys.swap_remove(slot);
        if slot == last {
            return;
        }
        for column in self.rows[slot].columns.clone() {
            // The last vertex's diagonal block is still in its own row, which has moved.
            let row = if column == last { slot } else { column };
            if let Some(value) = self.row_mut(row).remove(last, size) {
                self.row_mut(row).set(slot, &value);
            }
        }
    }
}

/// Every pair once; the other half of K mirrors it.
fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |p| (p..n).map(move |q| (p, q)))
}
