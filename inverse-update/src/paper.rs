//! `paper`: Sherman-Morrison-Woodbury, then bordering, in the order of Oishi et al.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Accum, Mat, MatRef, Par};

use crate::capacitance::{Capacitance, PIVOT_FLOOR};
use crate::counts::Tally;
use crate::drift::{DRIFT_LIMIT, is_too_far};
use crate::fresh::symmetric_inverse;
use crate::{
    Counts, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, full,
};

/// Keeps C = K⁻¹ dense, both halves, by the paper's formulas. V selects the p rows of the ring.
///
/// - (10): (K + V Δ Vᵀ)⁻¹ = C − C V Δ (I + Vᵀ C V Δ)⁻¹ Vᵀ C, Δ = K_c − K_p,
/// - (13): S = (A22 − A21 C A12)⁻¹,
/// - (12): [C + C A12 S A21 C, −C A12 S; −S A21 C, S],
/// - (15): C11 − C12 C22⁻¹ C21, then (10) with −Δ, for a merge.
///
/// The inner matrix of (10) is not symmetric and is solved by LU, so that C is symmetric to
/// rounding only, and rounding grows: a reference for what the paper's order costs and loses.
/// Like `woodbury` it starts afresh from K, and counts it, where K would not stay safely
/// positive definite, or quasi-definite. Cost: O(n²p + np² + p³) per update, O(n²) per solve, n²
/// numbers.
/// # Source
/// Oishi, Tagawa, Tanaka, eqs. (9)–(15).
pub struct Paper {
    stiffness: SparseStiffness,
    inverse: Mat<f64>,
    tally: Tally,
}

/// C ← C + L R: `left` n × k, `right` k × n.
struct Product {
    left: Mat<f64>,
    right: Mat<f64>,
}

/// Some columns and rows of an unsymmetric C, with updates not yet applied to all of it.
struct Part {
    columns: Mat<f64>,
    rows: Mat<f64>,
    at: Vec<usize>,
}

impl Part {
    fn of(c: &Mat<f64>, slots: &[usize], block: usize) -> Self {
        let at: Vec<usize> = slots.iter().flat_map(|&s| block * s..block * (s + 1)).collect();
        let columns = Mat::from_fn(c.nrows(), at.len(), |i, j| c[(i, at[j])]);
        let rows = Mat::from_fn(at.len(), c.nrows(), |i, j| c[(at[i], j)]);
        Self { columns, rows, at }
    }

    /// Vᵀ X: the part's rows of a matrix that has all rows.
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
    Capacitance::of_signed(what, sorted.as_ref(), negative.len())?;
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
    let factor = Capacitance::of("the ring's part of the inverse", own.as_ref())?;
    let g = Mat::<f64>::identity(delta.nrows(), delta.nrows())
        + factor.lower().transpose() * delta * factor.lower();
    let largest = (0..g.nrows()).fold(1.0, |worst: f64, i| worst.max(g[(i, i)].abs()));
    // The eigenvalues to tell from 0 start at 1; large others add rounding of their own size.
    let scale = vec![(largest * f64::EPSILON / PIVOT_FLOOR).max(1.0); g.nrows()];
    Capacitance::of_difference("I + Lᵀ Δ L", g.as_ref(), &scale)?;
    Ok(())
}

/// The inverse of a small matrix with `negative` rows of negative pivots at its end, by LU.
fn small_inverse(
    what: &'static str,
    matrix: &Mat<f64>,
    negative: usize,
) -> Result<Mat<f64>, InverseError> {
    Capacitance::of_signed(what, matrix.as_ref(), negative)?;
    Ok(matrix.partial_piv_lu().inverse())
}

impl Paper {
    /// Inverts `stiffness`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite, or quasi-definite as announced.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        let inverse = symmetric_inverse(&stiffness)?;
        Ok(Self { stiffness, inverse, tally: Tally::default() })
    }

    #[cfg(test)]
    pub(crate) fn spoil(&mut self, fraction: f64) {
        self.inverse
            .get_mut(..3, ..)
            .col_iter_mut()
            .for_each(|mut c| c *= faer::Scale(1.0 + fraction));
    }

    /// Adopts K after a failed update, with an inverse of its own.
    fn start_afresh(
        &mut self,
        cause: &InverseError,
        edit: impl FnOnce(&mut SparseStiffness),
    ) -> Result<(), InverseError> {
        let mut stiffness = self.stiffness.clone();
        edit(&mut stiffness);
        self.inverse = symmetric_inverse(&stiffness)?;
        tracing::warn!(%cause, "paper: update refused, inverse computed afresh");
        self.stiffness = stiffness;
        self.tally.rebuilt_for_pivot();
        Ok(())
    }

    /// Eqs. (10), (13), (12): what to add to C, and the border C A12 S, S A21 C, S.
    fn prepare_split(&self, change: &RingChange) -> Result<([Product; 2], Mat<f64>), InverseError> {
        let mut ring = Part::of(&self.inverse, &change.slots, self.stiffness.block());
        let update = ring.woodbury(&self.stiffness, (&change.k_c - &change.k_p).as_ref())?;
        ring.apply(&update);
        let column = &ring.columns * &change.a12;
        let row = change.a12.transpose() * &ring.rows;
        let schur = &change.a22 - change.a12.transpose() * ring.select_rows(&column);
        let s = small_inverse("A22 − A21 C A12", &schur, self.stiffness.negative())?;
        let border = Product { left: column * &s, right: row };
        let products = [update, border];
        self.check_diagonal(&products, 0..0)?;
        Ok((products, s))
    }

    /// Eq. (15), then (10).
    fn prepare_merge(
        &self,
        slot: usize,
        change: &RingChange,
    ) -> Result<[Product; 2], InverseError> {
        let block = self.stiffness.block();
        let own = Part::of(&self.inverse, &[slot], block);
        let c22 = own.select_rows(&own.columns);
        let c22 = small_inverse("C22", &c22, self.stiffness.negative())?;
        let removal = Product { left: -(&own.columns * &c22), right: own.rows };
        let mut ring = Part::of(&self.inverse, &change.slots, block);
        ring.apply(&removal);
        let update = ring.woodbury(&self.stiffness, (&change.k_p - &change.k_c).as_ref())?;
        let products = [removal, update];
        self.check_diagonal(&products, block * slot..block * (slot + 1))?;
        Ok(products)
    }

    /// A diagonal that is not finite and of the right sign is a failed update; NaN shows up in it.
    /// Rows about to be removed are let off: they end at 0.
    fn check_diagonal(
        &self,
        products: &[Product],
        removed: std::ops::Range<usize>,
    ) -> Result<(), InverseError> {
        for row in (0..self.inverse.nrows()).filter(|row| !removed.contains(row)) {
            let mut value = self.inverse[(row, row)];
            for product in products {
                for k in 0..product.left.ncols() {
                    value += product.left[(row, k)] * product.right[(k, row)];
                }
            }
            if !(self.stiffness.sign(row) * value > 0.0 && value.is_finite()) {
                let what = "the diagonal of the inverse";
                return Err(InverseError::Singular { what, row, value, limit: 0.0 });
            }
        }
        Ok(())
    }

    fn add(&mut self, product: &Product) {
        let (left, right) = (&product.left, &product.right);
        matmul(&mut self.inverse, Accum::Add, left, right, 1.0, Par::Seq);
    }

    /// Appends −C A12 S, −S A21 C and S.
    fn append(&mut self, border: &Product, s: &Mat<f64>) {
        let (old, m) = (self.inverse.nrows(), s.nrows());
        let n = old + m;
        let row = -(s * &border.right);
        // An eighth to spare; does nothing while the last reserve still has room.
        if self.inverse.col_stride() < n as isize {
            self.inverse.reserve(n + n / 8, n + n / 8);
        }
        self.inverse.resize_with(n, n, |i, j| match (i < old, j < old) {
            (true, _) => -border.left[(i, j - old)],
            (false, true) => row[(i - old, j)],
            (false, false) => s[(i - old, j - old)],
        });
    }

    fn swap_remove(&mut self, slot: usize, block: usize) {
        let kept = self.inverse.nrows() - block;
        let c = &mut self.inverse;
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
}

impl InverseMaintainer for Paper {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn vertices(&self) -> usize {
        self.stiffness.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        &self.stiffness
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.stiffness.check_split(change)?;
        match self.prepare_split(change) {
            Ok((products, s)) => {
                self.stiffness.apply_split(change);
                products.iter().for_each(|product| self.add(product));
                self.append(&products[1], &s);
            }
            Err(cause) => self.start_afresh(&cause, |k| k.apply_split(change))?,
        }
        Ok(self.vertices() - 1)
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.stiffness.check_merge(slot, change)?;
        let last = self.vertices() - 1;
        match self.prepare_merge(slot, change) {
            Ok(products) => {
                let block = self.stiffness.block();
                self.stiffness.apply_merge(slot, change);
                products.iter().for_each(|product| self.add(product));
                self.swap_remove(slot, block);
            }
            Err(cause) => self.start_afresh(&cause, |k| _ = k.apply_merge(slot, change))?,
        }
        Ok((slot != last).then_some(last))
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.stiffness.check_change(change)?;
        let ring = Part::of(&self.inverse, &change.slots, self.stiffness.block());
        let update = ring.woodbury(&self.stiffness, change.delta().as_ref()).and_then(|update| {
            let products = [update];
            self.check_diagonal(&products, 0..0)?;
            Ok(products)
        });
        match update {
            Ok([product]) => {
                self.stiffness.apply_change(change);
                self.add(&product);
                Ok(())
            }
            Err(cause) => self.start_afresh(&cause, |k| k.apply_change(change)),
        }
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        full::solve(&self.inverse, &self.stiffness, (f, u), &self.tally)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        full::columns(&self.inverse, slots, self.stiffness.block())
    }

    fn holds_columns(&self) -> bool {
        true
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.inverse = symmetric_inverse(&self.stiffness)?;
        Ok(())
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        let drift = full::drift(&self.inverse, &self.stiffness, seed);
        if is_too_far(self.name(), drift, DRIFT_LIMIT) {
            self.rebuild()?;
            self.tally.rebuilt_for_drift();
        }
        Ok(drift)
    }

    fn counts(&self) -> Counts {
        self.tally.counts()
    }
}
