//! What an update adds to K and takes from it, once large parts of a ring have cancelled.

use faer::{Mat, MatRef};

use super::batch::UpdateRef;
use super::capacitance::Capacitance;
use super::low_rank::{beside, pivoted};
use super::ring_change::RingChange;
use crate::InverseError;

/// M = U Λ Uᵀ on the rows of the vertices that stay, Λ = diag(1, −1), and the rows of a vertex that
/// is added: C_m: = T C_r:, C_mm = A22⁻¹ + T C_rr Tᵀ.
pub(crate) struct NetChange {
    /// What fails if the update does.
    pub what: &'static str,
    /// U = (P N), r × k.
    pub u: Mat<f64>,
    /// Columns of P, which come with +1.
    pub gained: usize,
    /// Tᵀ = −a12 A22⁻¹, r × m; m is 0 where no vertex is added.
    pub t: Mat<f64>,
    /// A22⁻¹, m × m.
    pub inverse: Mat<f64>,
}

impl NetChange {
    fn new(what: &'static str, gained: &Mat<f64>, lost: &Mat<f64>) -> Self {
        let u = beside(&[gained.as_ref(), lost.as_ref()]);
        let (t, inverse) = (Mat::zeros(u.nrows(), 0), Mat::zeros(0, 0));
        Self { what, u, gained: gained.ncols(), t, inverse }
    }

    /// Of one update, with `negative` rows of negative pivots per vertex.
    /// # Errors
    /// [`InverseError::Singular`] if the ring's own algebra fails.
    pub(crate) fn of(update: UpdateRef<'_>, negative: usize) -> Result<Self, InverseError> {
        let (change, is_split) = match update {
            UpdateRef::Split(change) => (change, true),
            UpdateRef::Merge(_, change) => (change, false),
            UpdateRef::Content(change) => {
                return Ok(Self::new("I + Uᵀ C U of a change", &change.added, &change.removed));
            }
        };
        let a22 = Capacitance::of("a22", change.a22.as_ref(), negative)?;
        let (gained, lost) = of_ring(change, &a22, negative)?;
        if !is_split {
            return Ok(Self::new("I + Uᵀ C U of a merge", &lost, &gained));
        }
        let t = -a22.solve(change.a12.as_ref());
        let inverse = a22.solve(Mat::<f64>::identity(t.ncols(), t.ncols()).as_ref());
        Ok(Self { t, inverse, ..Self::new("I + Uᵀ C U of a split", &gained, &lost) })
    }

    /// N.
    pub(crate) fn lost(&self) -> MatRef<'_, f64> {
        self.u.subcols(self.gained, self.u.ncols() - self.gained)
    }
}

/// P and N of M = F Fᵀ − N Nᵀ − b A22⁻¹ bᵀ, in as few columns as it takes.
///
/// Where a ring joins stiff and soft tissue, both terms are stiff and M may be soft. Updating
/// by one after the other would harden C by the stiffness ratio h and soften it again, which
/// costs ε h²; taking what is left of M first costs ε h, the rounding that K itself has in the
/// same rows. A split and its merge see the same M, so that even this does not add up.
/// Cost: that of [`pivoted`], none if F and N are empty.
fn of_ring(
    change: &RingChange,
    a22: &Capacitance,
    negative: usize,
) -> Result<(Mat<f64>, Mat<f64>), InverseError> {
    let released = a22.half_solve(change.b.as_ref());
    let (more, less, r) = (&change.positive, &change.negative, change.b.nrows());
    if r == 0 || more.ncols() + less.ncols() == 0 {
        let (lost, gained) = released.split_at_col(released.ncols() - negative);
        return Ok((gained.to_owned(), lost.to_owned()));
    }
    let is_conforming = (0..released.ncols()).all(|j| released.col(j).iter().all(|&x| x == 0.0));
    if is_conforming && less.ncols() == 0 {
        return Ok((more.clone(), less.clone()));
    }
    let (p, q) = (more.ncols(), more.ncols() + less.ncols());
    let all = beside(&[more.as_ref(), less.as_ref(), released.as_ref()]);
    let sign = |j: usize| match j {
        j if j < p => 1.0,
        j if j < q => -1.0,
        j => -a22.sign(j - q),
    };
    let signs: Vec<f64> = (0..all.ncols()).map(sign).collect();
    let (columns, signs) = pivoted(all.as_ref(), &signs).map_err(|value| {
        let what = "the ring's net change of stiffness";
        InverseError::Singular { what, row: 0, value, limit: f64::MAX }
    })?;
    let side = |sign: f64| {
        let kept: Vec<usize> = (0..signs.len()).filter(|&j| signs[j] == sign).collect();
        Mat::from_fn(r, kept.len(), |i, j| columns[(i, kept[j])])
    };
    Ok((side(1.0), side(-1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;

    #[test]
    fn stiff_parts_cancel_to_what_is_left() {
        // F Fᵀ − b A22⁻¹ bᵀ = [h, h; h, h] − [h, h; h, h + 1]: all but one soft entry cancels.
        let h = 1e12f64.sqrt();
        let freed = RingChange::freed(vec![0], Mat::zeros(2, 2), Mat::identity(2, 2), 0).unwrap();
        let (b, positive) = (mat![[h, 0.0], [h, 1.0]], mat![[h], [h]]);
        let change = RingChange { b, positive, ..freed };
        let net = NetChange::of(UpdateRef::Split(&change), 0).unwrap();
        let gained = net.u.subcols(0, net.gained);
        let m = gained * gained.transpose() - net.lost() * net.lost().transpose();
        // Rounding of the stiff terms, 1e12 ε, is what may remain.
        assert!((m - mat![[0.0, 0.0], [0.0, -1.0]]).norm_max() < 1e-3);
        assert!(gained.norm_max() < 0.1, "nothing stiff is added on the way");
    }

    #[test]
    fn one_sided_changes_pass_through() {
        let freed = RingChange::freed(vec![0], Mat::zeros(1, 1), mat![[4.0]], 0).unwrap();
        let mut change = RingChange { b: mat![[6.0]], ..freed };
        let net = NetChange::of(UpdateRef::Split(&change), 0).unwrap();
        assert_eq!((net.gained, net.u), (0, mat![[3.0]]));
        change.b = mat![[0.0]];
        change.positive = mat![[2.0]];
        let net = NetChange::of(UpdateRef::Split(&change), 0).unwrap();
        assert_eq!((net.gained, net.u), (1, mat![[2.0]]));
    }
}
