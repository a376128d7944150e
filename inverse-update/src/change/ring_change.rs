//! Split and merge: a ring of elements before and after the bisection of its edge, in slots.

use faer::{Mat, MatRef};

use super::capacitance::Capacitance;
use crate::InverseError;
use crate::matrix::{
    SparseStiffness, check_matrix, check_range, check_slots, check_symmetry, scaled_difference,
};

/// Largest relative residual at which the parts of a change still count as belonging together.
///
/// It catches wrong data, not rounding: a forgotten factor or a ring of another tetrahedron is
/// off by a few percent at least, rounding at E ratios of 1e9 by less than 1e-7.
pub const CONSISTENCY_LIMIT: f64 = 1e-6;

/// One ring of elements whose edge is bisected (a split) or restored (a merge).
///
/// Also made without elements, by [`freed`](Self::freed) where a vertex is no longer fixed and by
/// [`fixed`](Self::fixed) where it becomes so.
///
/// With R old free vertices, m rows per vertex and r = m·R, the stiffness changes from K to
/// K'' = [K + K_c − K_p, a12; a12ᵀ, A22]. Eliminating the new vertex leaves K + M with
/// M = K_c − a12 A22⁻¹ a12ᵀ − K_p = F Fᵀ − N Nᵀ − b A22⁻¹ bᵀ, written in factors so that nothing
/// cancels. `slots` may be empty (all old vertices are fixed): then only `a22` matters.
///
/// Units: N/m, `positive` and `negative` (N/m)^½. Rows are vertex-major in the order of `slots`.
#[derive(Debug, Clone)]
pub struct RingChange {
    /// The ring's old free vertices.
    pub slots: Vec<usize>,
    /// Stiffness of the coarse ring, r × r.
    pub k_p: Mat<f64>,
    /// Stiffness of the refined ring on the old rows, r × r.
    pub k_c: Mat<f64>,
    /// Coupling of the old rows to the new vertex, r × m.
    pub a12: Mat<f64>,
    /// Stiffness of the new vertex, m × m: positive definite, or quasi-definite as the matrix is.
    pub a22: Mat<f64>,
    /// b = a12 + Hᵀ A22, r × m: coupling to d = u_M − H u_old, with H = ½, ½ on the ends of the
    /// edge. Zero for families whose M is F Fᵀ − N Nᵀ alone.
    pub b: Mat<f64>,
    /// F, r × p: by how much the children are stiffer than their parent, moved as one field; p may
    /// be
    /// 0.
    pub positive: Mat<f64>,
    /// N, r × q: by how much they are softer; q may be 0. Below the parent's own stiffness where
    /// that is positive definite: K has to stay so.
    pub negative: Mat<f64>,
    /// The position of the new vertex, for maintainers that keep a sparse factor; see
    /// [`SparseStiffness::set_order_keys`](crate::SparseStiffness::set_order_keys).
    pub order_key: u64,
}

impl RingChange {
    /// The split by which a vertex becomes free: K becomes [K, a12; a12ᵀ, A22], to be given to
    /// [`InverseMaintainer::split`](crate::InverseMaintainer::split).
    ///
    /// A split of no tetrahedra, K_c = K_p = 0, with b = a12. Shapes: `a12` r × m, `a22` m × m with
    /// r = m · `slots.len()`, the vertices coupled to it. Units: N/m. Cost: O(r²).
    /// # Errors
    /// [`InverseError`] for shapes that don't fit, a NaN or infinity, a slot listed twice, or an
    /// A22 that is not symmetric.
    pub fn freed(
        slots: Vec<usize>,
        a12: Mat<f64>,
        a22: Mat<f64>,
        order_key: u64,
    ) -> Result<Self, InverseError> {
        let (m, r) = (a22.nrows(), a22.nrows() * slots.len());
        check_slots(&slots, usize::MAX)?;
        check_matrix("a22", a22.as_ref(), (m, m))?;
        check_matrix("a12", a12.as_ref(), (r, m))?;
        check_symmetry("a22", a22.as_ref())?;
        let (k_p, k_c) = (Mat::zeros(r, r), Mat::zeros(r, r));
        let (b, none) = (a12.clone(), Mat::zeros(r, 0));
        let (positive, negative) = (none.clone(), none);
        Ok(Self { slots, k_p, k_c, a12, a22, b, positive, negative, order_key })
    }

    /// The merge by which a vertex becomes fixed, its rows and columns leaving K: to be given to
    /// [`InverseMaintainer::merge`](crate::InverseMaintainer::merge) with the same `slot`.
    ///
    /// a12 and A22 are read off K. Kept, it frees the vertex again by a split as long as the slots
    /// of its neighbours are renewed. Cost: O(ring²).
    /// # Errors
    /// [`InverseError::Slot`] if `slot` is not in `0..stiffness.vertices()`.
    pub fn fixed(stiffness: &SparseStiffness, slot: usize) -> Result<Self, InverseError> {
        check_range(&[slot], stiffness.vertices())?;
        let m = stiffness.block();
        let others = stiffness.neighbours(slot).iter().copied();
        let slots: Vec<usize> = others.filter(|&other| other != slot).collect();
        let read = |row: usize, i: usize, j: usize| {
            stiffness.block_at(row, slot).map_or(0.0, |value| value[m * i + j])
        };
        let a12 = Mat::from_fn(m * slots.len(), m, |i, j| read(slots[i / m], i % m, j));
        let a22 = Mat::from_fn(m, m, |i, j| read(slot, i, j));
        Self::freed(slots, a12, a22, stiffness.order_keys()[slot])
    }

    /// Checks shapes, finiteness, slots, symmetry, A22 and the identity between the parts.
    ///
    /// `vertices`: the number of vertices without the new one; `block`: rows per vertex;
    /// `negative`: how many of them, at the end, have negative pivots.
    /// Cost: O(r²(q + m)).
    /// # Errors
    /// [`InverseError`]: the first defect found, by name, place, value and limit.
    pub fn check(
        &self,
        vertices: usize,
        block: usize,
        negative: usize,
    ) -> Result<(), InverseError> {
        check_slots(&self.slots, vertices)?;
        let r = block * self.slots.len();
        for (what, matrix, want) in self.shapes(r, block) {
            check_matrix(what, matrix, want)?;
        }
        check_symmetry("k_p", self.k_p.as_ref())?;
        check_symmetry("k_c", self.k_c.as_ref())?;
        check_symmetry("a22", self.a22.as_ref())?;
        let a22 = Capacitance::of("a22", self.a22.as_ref(), negative)?;
        let error = self.residual(&a22);
        // Written so that a NaN (an overflow on the way) is refused too.
        if error <= CONSISTENCY_LIMIT {
            return Ok(());
        }
        let what =
            "k_c − a12 a22⁻¹ a12ᵀ − k_p and positive positiveᵀ − negative negativeᵀ − b a22⁻¹ bᵀ";
        Err(InverseError::Inconsistent { what, error, limit: CONSISTENCY_LIMIT })
    }

    /// How far the parts are from K_c − a12 A22⁻¹ a12ᵀ − K_p = F Fᵀ − N Nᵀ − b A22⁻¹ bᵀ: the
    /// largest entry of the difference, each relative to √(s_i s_j) with s_i the largest of the
    /// terms' diagonals, signs left out: in a quasi-definite ring K_c,ii and K_p,ii may be what
    /// little is left of large terms, and rounding is that of the terms.
    ///
    /// Infinite where A22 is neither positive definite nor quasi-definite with its negative rows at
    /// the end, or the shapes do not fit.
    /// Cost: O(r²(q + m)).
    #[must_use]
    pub fn consistency_error(&self) -> f64 {
        let (r, m) = (self.k_p.nrows(), self.a22.nrows());
        let differs = |(_, matrix, want): (_, MatRef<'_, f64>, _)| matrix.shape() != want;
        if self.shapes(r, m).into_iter().any(differs) {
            return f64::INFINITY;
        }
        // A quasi-definite matrix shows the signs of its pivots on its diagonal.
        let negative = (0..m).rev().take_while(|&i| self.a22[(i, i)] < 0.0).count();
        match Capacitance::of("a22", self.a22.as_ref(), negative) {
            Ok(a22) => self.residual(&a22),
            Err(_) => f64::INFINITY,
        }
    }

    /// The parts by name, and the shapes that they should have for r old rows and m new ones.
    fn shapes(&self, r: usize, m: usize) -> [(&'static str, MatRef<'_, f64>, (usize, usize)); 7] {
        [
            ("k_p", self.k_p.as_ref(), (r, r)),
            ("k_c", self.k_c.as_ref(), (r, r)),
            ("a12", self.a12.as_ref(), (r, m)),
            ("a22", self.a22.as_ref(), (m, m)),
            ("b", self.b.as_ref(), (r, m)),
            ("positive", self.positive.as_ref(), (r, self.positive.ncols())),
            ("negative", self.negative.as_ref(), (r, self.negative.ncols())),
        ]
    }

    fn residual(&self, a22: &Capacitance) -> f64 {
        let condensed = a22.half_solve(self.a12.as_ref());
        let released = a22.half_solve(self.b.as_ref());
        let change = &self.k_c - &self.k_p - a22.signed_square(condensed.as_ref());
        let factors = &self.positive * self.positive.transpose()
            - &self.negative * self.negative.transpose()
            - a22.signed_square(released.as_ref());
        let terms = [&condensed, &released, &self.positive, &self.negative];
        let scale: Vec<f64> = (0..change.nrows())
            .map(|i| {
                let own = self.k_c[(i, i)].abs().max(self.k_p[(i, i)].abs());
                terms.iter().map(|term| term.row(i).squared_norm_l2()).fold(own, f64::max)
            })
            .collect();
        scaled_difference(change.as_ref(), factors.as_ref(), &scale, &scale)
    }
}
