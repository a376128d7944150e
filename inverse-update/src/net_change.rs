//! What a ring really gains and loses in stiffness, once its large parts have cancelled.

use faer::{Mat, Side};

use crate::capacitance::Capacitance;
use crate::update::LowRank;
use crate::{InverseError, RingChange};

/// M = P Pᵀ − N Nᵀ on the ring's old rows, as few columns as it takes.
pub(crate) struct NetChange {
    /// P, r × p.
    pub gained: Mat<f64>,
    /// N, r × q.
    pub lost: Mat<f64>,
}

/// The rows of C of a vertex that comes in: C_m: = T C_r:, C_mm = A22⁻¹ + T C_rr Tᵀ.
pub(crate) struct NewRows {
    /// Tᵀ = −a12 A22⁻¹, r × m.
    pub t: Mat<f64>,
    /// A22⁻¹.
    pub inverse: Mat<f64>,
}

impl NewRows {
    pub(crate) fn new(change: &RingChange, negative: usize) -> Result<Self, InverseError> {
        let a22 = Capacitance::of_signed("a22", change.a22.as_ref(), negative)?;
        let m = change.a22.nrows();
        Ok(Self {
            t: -a22.solve(change.a12.as_ref()),
            inverse: a22.solve(Mat::<f64>::identity(m, m).as_ref()),
        })
    }
}

impl NetChange {
    /// What the old rows of K gain and lose when the vertex comes in.
    pub(crate) fn of_split(&self) -> LowRank<'_> {
        let (gained, lost) = (self.gained.as_ref(), self.lost.as_ref());
        LowRank { what: "I + Uᵀ C U of a split", gained, lost }
    }

    /// And when it goes.
    pub(crate) fn of_merge(&self) -> LowRank<'_> {
        let (gained, lost) = (self.lost.as_ref(), self.gained.as_ref());
        LowRank { what: "I + Uᵀ C U of a merge", gained, lost }
    }

    /// From M = F Fᵀ − N Nᵀ − b A22⁻¹ bᵀ.
    ///
    /// Where a ring joins stiff and soft tissue, both terms are stiff and M may be soft. Updating
    /// by one after the other would harden C by the stiffness ratio h and soften it again, which
    /// costs ε h²; taking M's eigenvectors first costs ε h, the rounding that K itself has in the
    /// same rows. A split and its merge see the same M, so that even this does not add up.
    /// `negative`: rows of A22 with negative pivots. Cost: O((r + k) k²) with k = 3 + q columns,
    /// none if F and N are empty.
    pub(crate) fn new(change: &RingChange, negative: usize) -> Result<Self, InverseError> {
        let a22 = Capacitance::of_signed("a22", change.a22.as_ref(), negative)?;
        let released = a22.half_solve(change.b.as_ref());
        let (more, less, r) = (&change.positive, &change.negative, change.b.nrows());
        if r == 0 || more.ncols() + less.ncols() == 0 {
            let (lost, gained) = released.split_at_col(released.ncols() - negative);
            return Ok(Self { gained: gained.to_owned(), lost: lost.to_owned() });
        }
        let is_conforming =
            (0..released.ncols()).all(|j| released.col(j).iter().all(|&x| x == 0.0));
        if is_conforming && less.ncols() == 0 {
            return Ok(Self { gained: more.clone(), lost: less.clone() });
        }
        let (p, q) = (more.ncols(), more.ncols() + less.ncols());
        let k = q + released.ncols();
        let all = Mat::from_fn(r, k, |i, j| match j {
            j if j < p => more[(i, j)],
            j if j < q => less[(i, j - p)],
            j => released[(i, j - q)],
        });
        // Displacements and pressures have sizes of their own: rows of equal size keep the digits
        // of both.
        let size = |i: usize| match all.row(i).norm_l2() {
            norm if negative > 0 && norm > 0.0 => norm,
            _ => 1.0,
        };
        let scale: Vec<f64> = (0..r).map(size).collect();
        let qr = Mat::from_fn(r, k, |i, j| all[(i, j)] / scale[i]).qr();
        let (basis, upper) = (qr.compute_thin_Q(), qr.thin_R());
        let sign = |j: usize| match j {
            j if j < p => 1.0,
            j if j < q => -1.0,
            j => -a22.sign(j - q),
        };
        let signed = Mat::from_fn(upper.nrows(), k, |i, j| sign(j) * upper[(i, j)]);
        let small = signed * upper.transpose();
        let failed = |what| InverseError::Singular {
            what,
            row: 0,
            value: small.norm_max(),
            limit: f64::MAX,
        };
        let eigen = small
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| failed("the ring's net change of stiffness"))?;
        let values: Vec<f64> = eigen.S().column_vector().iter().copied().collect();
        let vectors = basis * eigen.U();
        // Smaller eigenvalues are rounding of the largest.
        let floor = 0.25 * f64::EPSILON * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let side = |sign: f64| {
            let kept: Vec<usize> =
                (0..values.len()).filter(|&j| sign * values[j] > floor).collect();
            Mat::from_fn(r, kept.len(), |i, j| {
                scale[i] * vectors[(i, kept[j])] * values[kept[j]].abs().sqrt()
            })
        };
        Ok(Self { gained: side(1.0), lost: side(-1.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;

    #[test]
    fn stiff_parts_cancel_to_what_is_left() {
        // F Fᵀ − b A22⁻¹ bᵀ = [h, h; h, h] − [h, h; h, h + 1]: all but one soft entry cancels.
        let h = 1e12f64.sqrt();
        let change = RingChange {
            slots: vec![0, 1],
            k_p: Mat::zeros(2, 2),
            k_c: Mat::zeros(2, 2),
            a12: Mat::zeros(2, 2),
            a22: mat![[1.0, 0.0], [0.0, 1.0]],
            b: mat![[h, 0.0], [h, 1.0]],
            positive: mat![[h], [h]],
            negative: Mat::zeros(2, 0),
            order_key: 0,
        };
        let net = NetChange::new(&change, 0).unwrap();
        let m = &net.gained * net.gained.transpose() - &net.lost * net.lost.transpose();
        // Rounding of the stiff terms, 1e12 ε, is what may remain.
        assert!((m - mat![[0.0, 0.0], [0.0, -1.0]]).norm_max() < 1e-3);
        assert!(net.gained.norm_max() < 0.1, "nothing stiff is added on the way");
    }

    #[test]
    fn one_sided_changes_pass_through() {
        let mut change = RingChange {
            slots: vec![0],
            k_p: Mat::zeros(1, 1),
            k_c: Mat::zeros(1, 1),
            a12: Mat::zeros(1, 1),
            a22: mat![[4.0]],
            b: mat![[6.0]],
            positive: Mat::zeros(1, 0),
            negative: Mat::zeros(1, 0),
            order_key: 0,
        };
        let net = NetChange::new(&change, 0).unwrap();
        assert_eq!((net.gained.ncols(), net.lost), (0, mat![[3.0]]));
        change.b = mat![[0.0]];
        change.positive = mat![[2.0]];
        let net = NetChange::new(&change, 0).unwrap();
        assert_eq!((net.gained, net.lost.ncols()), (mat![[2.0]], 0));
    }
}
