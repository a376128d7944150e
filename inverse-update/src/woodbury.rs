//! `woodbury`: low-rank updates in the factors of the change, one fused pass over half of C.

use faer::Mat;

use crate::capacitance::Capacitance;
use crate::change::{check_length, check_range, check_vector};
use crate::fresh::cholesky_inverse;
use crate::net_change::NetChange;
use crate::packed::PackedSymmetric;
use crate::signed_columns::SignedColumns;
use crate::{InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange};

/// Keeps C = K⁻¹ dense, lower half only, by symmetric low-rank updates.
///
/// Eliminating the new vertex leaves K + F Fᵀ − b A22⁻¹ bᵀ = K + P Pᵀ − N Nᵀ on the old rows (P
/// and N without what cancels between stiff and soft tissue), so a split is
/// 1. Z = C_:r P, G = I + Pᵀ Z_r = L Lᵀ, Y = Z L⁻ᵀ, C ← C − Y Yᵀ,
/// 2. Z = C_:r N, G = I − Nᵀ Z_r = L Lᵀ, W = Z L⁻ᵀ, C ← C + W Wᵀ,
/// 3. T = −A22⁻¹ a12ᵀ, C_m: = T C_r:, C_mm = A22⁻¹ + T C_rr Tᵀ,
///
/// and a merge the same in reverse. All of it is computed on the ring's columns first; then C is
/// read and written once. A factor G that fails (nearly singular change) makes the maintainer
/// start afresh from K, which `rebuilds` counts.
///
/// Cost: O(n²(3 + q)) per update, O(n²) per solve, n²/2 numbers.
/// # Source
/// Hager, Updating the inverse of a matrix, SIAM Review 31(2), 1989.
pub struct Woodbury {
    stiffness: SparseStiffness,
    inverse: PackedSymmetric,
    rebuilds: usize,
}

/// The new vertex's rows of C, to append.
struct Border {
    coupling: Mat<f64>,
    own: Mat<f64>,
}

impl Woodbury {
    /// Inverts `stiffness`. Cost: O(n³).
    ///
    /// # Errors
    /// [`InverseError::Singular`] if it is not positive definite.
    pub fn new(stiffness: SparseStiffness) -> Result<Self, InverseError> {
        let inverse = PackedSymmetric::from_lower(cholesky_inverse(&stiffness)?.as_ref());
        Ok(Self { stiffness, inverse, rebuilds: 0 })
    }

    /// Adopts K after a failed update, with an inverse of its own.
    fn start_afresh(
        &mut self,
        cause: &InverseError,
        edit: impl FnOnce(&mut SparseStiffness),
    ) -> Result<(), InverseError> {
        let mut stiffness = self.stiffness.clone();
        edit(&mut stiffness);
        let next = Self::new(stiffness)?;
        tracing::warn!(%cause, "woodbury: update refused, inverse computed afresh");
        self.stiffness = next.stiffness;
        self.inverse = next.inverse;
        self.rebuilds += 1;
        Ok(())
    }

    fn prepare_split(&self, change: &RingChange) -> Result<(SignedColumns, Border), InverseError> {
        let ring = Ring::new(self, &change.slots);
        let net = NetChange::new(change, 0)?;
        let stiffer = ring.subtract("I + Pᵀ C P", &net.gained)?;
        let softer = ring.add("I − Nᵀ C N", &net.lost, (&net.gained, &stiffer))?;
        let a22 = Capacitance::of("a22", change.a22.as_ref())?;
        let minus_t = a22.solve(change.a12.as_ref());
        // C_:r Tᵀ after both updates, from the ring's columns alone.
        let mut coupling = -(&ring.columns * &minus_t);
        coupling += &stiffer * (ring.rows(&stiffer).transpose() * &minus_t);
        coupling -= &softer * (ring.rows(&softer).transpose() * &minus_t);
        let m = change.a22.nrows();
        let own = a22.solve(Mat::<f64>::identity(m, m).as_ref())
            - minus_t.transpose() * ring.rows(&coupling);
        let terms = SignedColumns::new(stiffer.as_ref(), softer.as_ref());
        self.check_diagonal(&terms)?;
        for a in 0..m {
            check_positive(self.inverse.rows() + a, own[(a, a)])?;
        }
        Ok((terms, Border { coupling, own }))
    }

    fn prepare_merge(&self, change: &RingChange) -> Result<SignedColumns, InverseError> {
        let ring = Ring::new(self, &change.slots);
        let net = NetChange::new(change, 0)?;
        let stiffer = ring.subtract("I + Nᵀ C N", &net.lost)?;
        let softer = ring.add("I − Pᵀ C P", &net.gained, (&net.lost, &stiffer))?;
        let terms = SignedColumns::new(stiffer.as_ref(), softer.as_ref());
        self.check_diagonal(&terms)?;
        Ok(terms)
    }

    fn prepare_change(&self, change: &StiffnessChange) -> Result<SignedColumns, InverseError> {
        let ring = Ring::new(self, &change.slots);
        let stiffer = ring.subtract("I + Aᵀ C A", &change.added)?;
        let softer = ring.add("I − Bᵀ C B", &change.removed, (&change.added, &stiffer))?;
        let terms = SignedColumns::new(stiffer.as_ref(), softer.as_ref());
        self.check_diagonal(&terms)?;
        Ok(terms)
    }

    /// A positive, finite diagonal bounds all of C; anything else is a failed update.
    fn check_diagonal(&self, terms: &SignedColumns) -> Result<(), InverseError> {
        (0..self.inverse.rows())
            .try_for_each(|i| check_positive(i, self.inverse.diagonal(i) + terms.diagonal(i)))
    }
}

fn check_positive(row: usize, value: f64) -> Result<(), InverseError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    let what = "the diagonal of the inverse";
    Err(InverseError::Singular { what, row, value, limit: 0.0 })
}

/// The smallest pivot of I − NᵀCN without refinement. Softening by h = 1/pivot multiplies the
/// relative error that stiff modes have in C, ε h, by h once more: beyond 100 that adds up.
const SOFTENING: f64 = 1e-2;

/// The ring's columns of C and what can be done with them.
struct Ring<'a> {
    stiffness: &'a SparseStiffness,
    inverse: &'a PackedSymmetric,
    columns: Mat<f64>,
    rows: Vec<usize>,
}

impl<'a> Ring<'a> {
    fn new(of: &'a Woodbury, slots: &[usize]) -> Self {
        let block = of.stiffness.block();
        let rows = slots.iter().flat_map(|&slot| block * slot..block * (slot + 1)).collect();
        let columns = of.inverse.gather(slots, block);
        Self { stiffness: &of.stiffness, inverse: &of.inverse, columns, rows }
    }

    /// The ring's rows of a matrix that has all rows.
    fn rows(&self, matrix: &Mat<f64>) -> Mat<f64> {
        Mat::from_fn(self.rows.len(), matrix.ncols(), |i, j| matrix[(self.rows[i], j)])
    }

    /// Y with C − Y Yᵀ = (K + V Vᵀ)⁻¹.
    fn subtract(&self, what: &'static str, v: &Mat<f64>) -> Result<Mat<f64>, InverseError> {
        if v.ncols() == 0 {
            return Ok(Mat::zeros(self.columns.nrows(), 0));
        }
        let z = &self.columns * v;
        let g = Mat::<f64>::identity(v.ncols(), v.ncols()) + v.transpose() * self.rows(&z);
        Ok(Capacitance::of(what, g.as_ref())?.half_solve(z.as_ref()))
    }

    /// W with C' + W Wᵀ = (K' − V Vᵀ)⁻¹, where K' = K + U Uᵀ for the U of an earlier
    /// [`subtract`](Self::subtract) and C' = C − Y Yᵀ for its Y.
    fn add(
        &self,
        what: &'static str,
        v: &Mat<f64>,
        earlier: (&Mat<f64>, &Mat<f64>),
    ) -> Result<Mat<f64>, InverseError> {
        if v.ncols() == 0 {
            return Ok(Mat::zeros(self.columns.nrows(), 0));
        }
        let one = Mat::<f64>::identity(v.ncols(), v.ncols());
        let mut z = &self.columns * v;
        z -= earlier.1 * (self.rows(earlier.1).transpose() * v);
        let g = &one - v.transpose() * self.rows(&z);
        let factor = Capacitance::of_difference(what, g.as_ref(), &vec![1.0; g.nrows()])?;
        let w = factor.half_solve(z.as_ref());
        if factor.smallest_pivot() > SOFTENING {
            return Ok(w);
        }
        // C''V by one step of refinement against K, and W from it: I + VᵀC''V does not cancel.
        let mut softened = z + &w * (self.rows(&w).transpose() * v);
        let residual = self.residual(v, earlier.0, &softened)?;
        softened += self.inverse.multiply_columns(&residual);
        softened -= earlier.1 * (earlier.1.transpose() * &residual);
        softened += &w * (w.transpose() * &residual);
        let g = one + v.transpose() * self.rows(&softened);
        Ok(Capacitance::of(what, g.as_ref())?.half_solve(softened.as_ref()))
    }

    /// V − (K + U Uᵀ − V Vᵀ) X, V and U given on the ring's rows.
    fn residual(&self, v: &Mat<f64>, u: &Mat<f64>, x: &Mat<f64>) -> Result<Mat<f64>, InverseError> {
        let mut residual = Mat::zeros(x.nrows(), x.ncols());
        let mut product = vec![0.0; x.nrows()];
        for j in 0..x.ncols() {
            self.stiffness.apply(x.col_as_slice(j), &mut product)?;
            for (target, value) in residual.col_as_slice_mut(j).iter_mut().zip(&product) {
                *target = -value;
            }
        }
        let at = self.rows(x);
        let own = v - u * (u.transpose() * &at) + v * (v.transpose() * &at);
        for (i, &row) in self.rows.iter().enumerate() {
            for j in 0..x.ncols() {
                residual[(row, j)] += own[(i, j)];
            }
        }
        Ok(residual)
    }
}

impl InverseMaintainer for Woodbury {
    fn name(&self) -> &'static str {
        "woodbury"
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
            Ok((terms, border)) => {
                self.stiffness.apply_split(change);
                self.inverse.add(&terms);
                self.inverse.append(border.coupling.as_ref(), border.own.as_ref());
            }
            Err(cause) => self.start_afresh(&cause, |k| k.apply_split(change))?,
        }
        Ok(self.vertices() - 1)
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.stiffness.check_merge(slot, change)?;
        let last = self.vertices() - 1;
        match self.prepare_merge(change) {
            Ok(mut terms) => {
                let block = self.stiffness.block();
                self.stiffness.apply_merge(slot, change);
                self.inverse.swap_remove(slot, block);
                terms.swap_remove(slot, block);
                self.inverse.add(&terms);
            }
            Err(cause) => self.start_afresh(&cause, |k| _ = k.apply_merge(slot, change))?,
        }
        Ok((slot != last).then_some(last))
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.stiffness.check_change(change)?;
        match self.prepare_change(change) {
            Ok(terms) => {
                self.stiffness.apply_change(change);
                self.inverse.add(&terms);
                Ok(())
            }
            Err(cause) => self.start_afresh(&cause, |k| k.apply_change(change)),
        }
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        let rows = self.inverse.rows();
        check_vector("f", f, rows)?;
        check_length("u", u, rows)?;
        self.inverse.multiply(f, u);
        Ok(())
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        check_range(slots, self.vertices())?;
        Ok(self.inverse.gather(slots, self.stiffness.block()))
    }

    fn holds_columns(&self) -> bool {
        true
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        let inverse = cholesky_inverse(&self.stiffness)?;
        self.inverse = PackedSymmetric::from_lower(inverse.as_ref());
        Ok(())
    }

    fn rebuilds(&self) -> usize {
        self.rebuilds
    }
}
