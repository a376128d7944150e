//! `paper`: Sherman-Morrison-Woodbury, then bordering, in the order of Oishi et al.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Accum, Mat, MatRef, Par};

use super::from_stiffness::symmetric_inverse;
use super::full_storage::Full;
use super::signed_root::check_diagonal;
use crate::InverseError;
use crate::change::{Capacitance, PIVOT_FLOOR, RingChange, UpdateRef};
use crate::maintained::{Maintained, Method};
use crate::matrix::SparseStiffness;

/// Keeps C = K⁻¹ dense, both halves, by the paper's formulas. V selects the p rows of the ring.
///
/// - (10): (K + V Δ Vᵀ)⁻¹ = C − C V Δ (I + Vᵀ C V Δ)⁻¹ Vᵀ C, Δ = K_c − K_p,
/// - (13): S = (A22 − A21 C A12)⁻¹,
/// - (12): [C + C A12 S A21 C, −C A12 S; −S A21 C, S],
/// - (15): C11 − C12 C22⁻¹ C21, then (10) with −Δ, for a merge.
///
/// The inner matrix of (10) is not symmetric and is solved by LU, so that C is symmetric to
/// rounding only, and rounding grows: a reference for what the paper's order costs and loses.
/// Like `woodbury` it rebuilds C from K, and counts it, where K would not stay safely positive
/// definite, or quasi-definite. Cost: O(n²p + np² + p³) per update, O(n²) per solve, n²
/// numbers.
/// # Source
/// Oishi, Tagawa, Tanaka, eqs. (9)–(15).
pub type Paper = Maintained<PaperMethod>;

/// See [`Paper`].
#[derive(Default)]
pub struct PaperMethod(Full);

/// C ← C + L R: `left` n × k, `right` k × n.
struct Product {
    left: Mat<f64>,
    right: Mat<f64>,
}

/// Some columns and rows of an unsymmetric C, with updates not yet applied to all of it.
struct Selected {
    columns: Mat<f64>,
    rows: Mat<f64>,
    at: Vec<usize>,
}

impl Selected {
    fn of(c: &Mat<f64>, k: &SparseStiffness, slots: &[usize]) -> Self {
        let at = k.rows_of(slots);
        let columns = Mat::from_fn(c.nrows(), at.len(), |i, j| c[(i, at[j])]);
        let rows = Mat::from_fn(at.len(), c.nrows(), |i, j| c[(at[i], j)]);
        Self { columns, rows, at }
    }

    /// Vᵀ X: the selected rows of a matrix that has all rows.
    fn select_rows(&self, x: &Mat<f64>) -> Mat<f64> {
        Mat::from_fn(self.at.len(), x.ncols(), |i, j| x[(self.at[i], j)])
    }

    fn select_columns(&self, x: &Mat<f64>) -> Mat<f64> {
        Mat::from_fn(x.nrows(), self.at.len(), |i, j| x[(i, self.at[j])])
    }

    fn apply(&mut self, product: &Product) {
        self.columns += &product.left * self.select_columns(&product.right);
        self.rows += self.select_rows(&product.left) * &product.right;
    }

    /// Eqs. (10), (13), (12): what to add to C, with the border C A12 S, S A21 C as the second
    /// product, and S.
    fn split(
        &mut self,
        k: &SparseStiffness,
        change: &RingChange,
    ) -> Result<(Vec<Product>, Mat<f64>), InverseError> {
        let update = self.woodbury(k, (&change.k_c - &change.k_p).as_ref())?;
        self.apply(&update);
        let column = &self.columns * &change.a12;
        let row = change.a12.transpose() * &self.rows;
        let schur = &change.a22 - change.a12.transpose() * self.select_rows(&column);
        let s = small_inverse("A22 − A21 C A12", &schur, k.negative())?;
        let border = Product { left: column * &s, right: row };
        Ok((vec![update, border], s))
    }

    /// Eq. (10) without its first term.
    fn woodbury(
        &self,
        k: &SparseStiffness,
        delta: MatRef<'_, f64>,
    ) -> Result<Product, InverseError> {
        let p = delta.nrows();
        let own = self.select_rows(&self.columns);
        if k.negative() == 0 {
            check_stays_definite(&own, delta)?;
        }
        let capacitance = Mat::<f64>::identity(p, p) + &own * delta;
        let right = capacitance.partial_piv_lu().solve(&self.rows);
        let product = Product { left: -(&self.columns * delta), right };
        if k.negative() > 0 {
            let change = self.select_rows(&product.left) * self.select_columns(&product.right);
            check_stays_quasi_definite(k, &own, &(&own + change))?;
        }
        Ok(product)
    }
}

/// K keeps its inertia iff C_rr does, the inverse of its Schur complement on the ring: with the
/// negative rows at the end it has a signed L Σ Lᵀ before and after. Cost: O(p³).
fn check_stays_quasi_definite(
    k: &SparseStiffness,
    before: &Mat<f64>,
    after: &Mat<f64>,
) -> Result<(), InverseError> {
    let what = "the ring's part of the inverse";
    let (positive, negative): (Vec<usize>, Vec<usize>) =
        (0..after.nrows()).partition(|&i| k.sign(i) > 0.0);
    let order: Vec<usize> = positive.iter().chain(&negative).copied().collect();
    let n = order.len();
    let sorted = Mat::from_fn(n, n, |i, j| after[(order[i], order[j])]);
    Capacitance::of(what, sorted.as_ref(), negative.len())?;
    for row in 0..n {
        // A row that becomes this much softer has lost half of its digits.
        let value = (before[(row, row)] / after[(row, row)]).abs();
        if !(value > PIVOT_FLOOR) {
            return Err(InverseError::Singular { what, row, value, limit: PIVOT_FLOOR });
        }
    }
    Ok(())
}

/// K + V Δ Vᵀ is positive definite iff I + Lᵀ Δ L is, with L Lᵀ = Vᵀ C V: LU would invert an
/// indefinite matrix without a word. Cost: O(p³).
fn check_stays_definite(own: &Mat<f64>, delta: MatRef<'_, f64>) -> Result<(), InverseError> {
    let factor = Capacitance::of("the ring's part of the inverse", own.as_ref(), 0)?;
    let g = Mat::<f64>::identity(delta.nrows(), delta.nrows())
        + factor.lower().transpose() * delta * factor.lower();
    let largest = (0..g.nrows()).fold(1.0, |worst: f64, i| worst.max(g[(i, i)].abs()));
    // The eigenvalues to tell from 0 start at 1; large others add rounding of their own size.
    let scale = vec![(largest * f64::EPSILON / PIVOT_FLOOR).max(1.0); g.nrows()];
    Capacitance::of_difference("I + Lᵀ Δ L", g.as_ref(), &scale)?;
    Ok(())
}

/// Eq. (15).
fn removal(c: &Mat<f64>, k: &SparseStiffness, slot: usize) -> Result<Product, InverseError> {
    let own = Selected::of(c, k, &[slot]);
    let c22 = small_inverse("C22", &own.select_rows(&own.columns), k.negative())?;
    Ok(Product { left: -(&own.columns * &c22), right: own.rows })
}

/// The inverse of a small matrix with `negative` rows of negative pivots at its end, by LU.
fn small_inverse(
    what: &'static str,
    matrix: &Mat<f64>,
    negative: usize,
) -> Result<Mat<f64>, InverseError> {
    Capacitance::of(what, matrix.as_ref(), negative)?;
    Ok(matrix.partial_piv_lu().inverse())
}

impl PaperMethod {
    /// What to add to C, and the corner S of a new vertex.
    fn prepare(
        &self,
        k: &SparseStiffness,
        update: UpdateRef<'_>,
    ) -> Result<(Vec<Product>, Mat<f64>), InverseError> {
        let c = &self.0.0;
        let mut ring = Selected::of(c, k, update.slots());
        let (products, own) = match update {
            UpdateRef::Split(change) => ring.split(k, change)?,
            UpdateRef::Merge(slot, change) => {
                let removal = removal(c, k, slot)?;
                ring.apply(&removal);
                let update = ring.woodbury(k, (&change.k_p - &change.k_c).as_ref())?;
                (vec![removal, update], Mat::new())
            }
            UpdateRef::Content(change) => {
                (vec![ring.woodbury(k, change.delta().as_ref())?], Mat::new())
            }
        };
        let diagonal = (0..c.nrows()).map(|row| {
            let mut value = c[(row, row)];
            for product in &products {
                for k in 0..product.left.ncols() {
                    value += product.left[(row, k)] * product.right[(k, row)];
                }
            }
            value
        });
        check_diagonal(k, diagonal, &update.removed_rows(k))?;
        Ok((products, own))
    }
}

/// Appends −C A12 S, −S A21 C and S to C.
fn append(c: &mut Mat<f64>, border: &Product, s: &Mat<f64>) {
    let (old, m) = (c.nrows(), s.nrows());
    let n = old + m;
    let row = -(s * &border.right);
    // Reserves an eighth more than needed; does nothing while the capacity suffices.
    if c.col_stride() < n as isize {
        c.reserve(n + n / 8, n + n / 8);
    }
    c.resize_with(n, n, |i, j| match (i < old, j < old) {
        (true, _) => -border.left[(i, j - old)],
        (false, true) => row[(i - old, j)],
        (false, false) => s[(i - old, j - old)],
    });
}

/// Removes the rows and columns of a slot; the last slot's move into the gap.
fn swap_remove(c: &mut Mat<f64>, slot: usize, block: usize) {
    let kept = c.nrows() - block;
    for a in 0..block {
        for i in 0..kept + block {
            c[(i, block * slot + a)] = c[(i, kept + a)];
        }
    }
    for a in 0..block {
        for j in 0..kept {
            c[(block * slot + a, j)] = c[(kept + a, j)];
        }
    }
    c.truncate(kept, kept);
}

impl Method for PaperMethod {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn invert(&mut self, k: &SparseStiffness) -> Result<(), InverseError> {
        self.0 = Full(symmetric_inverse(k)?);
        Ok(())
    }

    fn update(&mut self, k: &SparseStiffness, update: UpdateRef<'_>) -> Result<(), InverseError> {
        let (products, own) = self.prepare(k, update)?;
        let c = &mut self.0.0;
        for Product { left, right } in &products {
            matmul(&mut *c, Accum::Add, left, right, 1.0, Par::Seq);
        }
        match update {
            UpdateRef::Split(_) => append(c, &products[1], &own),
            UpdateRef::Merge(slot, _) => swap_remove(c, slot, k.block()),
            UpdateRef::Content(_) => {}
        }
        Ok(())
    }

    fn multiply(&self, _: &SparseStiffness, x: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        Ok(self.0.multiply(x))
    }

    fn columns(&self, _: &SparseStiffness, rows: &[usize]) -> Result<Mat<f64>, InverseError> {
        Ok(self.0.columns(rows))
    }
}
