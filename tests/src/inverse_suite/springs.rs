//! Small matrices by hand and how maintainers of them are looked at.

use std::fmt::Debug;
use std::ops::{Deref, DerefMut};

use faer::{Mat, mat};
use yawara_inverse_update::{
    InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange,
};

use super::{build, residual};

/// The maintainer of a name with a small matrix.
pub(super) struct Case<'a> {
    name: &'a str,
    maintainer: Box<dyn InverseMaintainer>,
}

impl Deref for Case<'_> {
    type Target = dyn InverseMaintainer;

    fn deref(&self) -> &Self::Target {
        &*self.maintainer
    }
}

impl DerefMut for Case<'_> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut *self.maintainer
    }
}

impl<'a> Case<'a> {
    /// Starts from a dense matrix of `block` rows per vertex, the last `negative` of them pressures.
    pub(super) fn new(
        name: &'a str,
        (block, negative): (usize, usize),
        k: &Mat<f64>,
    ) -> Result<Self, InverseError> {
        let vertices = k.nrows() / block;
        let mut stiffness = SparseStiffness::quasi_definite(vertices, block, negative)?;
        stiffness.add(&(0..vertices).collect::<Vec<_>>(), k.as_ref())?;
        Ok(Self { name, maintainer: build(name, stiffness)? })
    }

    /// Vertices of one row.
    pub(super) fn springs(name: &'a str, k: &Mat<f64>) -> Self {
        Self::new(name, (1, 0), k).unwrap()
    }

    /// Vertices of one displacement and one pressure.
    pub(super) fn mixed(name: &'a str, k: &Mat<f64>) -> Self {
        Self::new(name, (2, 1), k).unwrap()
    }

    pub(super) fn inverse(&self) -> Mat<f64> {
        let all: Vec<usize> = (0..self.vertices()).collect();
        self.columns(&all).expect("all slots")
    }

    /// Whether the inverse is what is known by hand.
    pub(super) fn shows(&self, want: &Mat<f64>) {
        self.close(&self.inverse(), want);
    }

    pub(super) fn close(&self, got: &Mat<f64>, want: &Mat<f64>) {
        let name = self.name;
        assert_eq!(got.shape(), want.shape(), "{name}");
        // The matrices by hand have condition numbers below 100 and at most 5 rows.
        let limit = 100.0 * (5.0 * f64::EPSILON + residual(name)) * want.norm_max();
        let is_close = got.is_all_finite() && (got - want).norm_max() <= limit;
        assert!(is_close, "{name}: {got:?}\nwant {want:?}");
    }

    /// Runs something that has to fail and proves that nothing has changed, to the last bit.
    pub(super) fn refuses<T: Debug>(
        &mut self,
        attempt: impl FnOnce(&mut dyn InverseMaintainer) -> Result<T, InverseError>,
    ) -> InverseError {
        let n = self.stiffness().dofs();
        let f: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64).sin()).collect();
        let state = |case: &Self| {
            let mut u = vec![0.0; n];
            case.solve(&f, &mut u).expect("a finite load");
            let k = case.stiffness().to_dense();
            (u, case.inverse(), k, case.vertices(), case.counts().rebuilds)
        };
        let before = state(self);
        let error = attempt(&mut **self).expect_err("this has to be refused");
        assert!(state(self) == before, "changed by a refused call: {error}");
        error
    }

    /// The same for what leaves K without an inverse, or with pivots of other signs.
    pub(super) fn finds_singular<T: Debug>(
        &mut self,
        attempt: impl FnOnce(&mut dyn InverseMaintainer) -> Result<T, InverseError>,
    ) -> InverseError {
        let error = self.refuses(attempt);
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
        error
    }
}

/// A ring without factors, b = 0.
pub(super) fn ring<const R: usize>(
    slots: [usize; R],
    [k_p, k_c, a12, a22]: [Mat<f64>; 4],
) -> RingChange {
    let (r, m) = a12.shape();
    let (b, positive, negative) = (Mat::zeros(r, m), Mat::zeros(r, 0), Mat::zeros(r, 0));
    RingChange { slots: slots.into(), k_p, k_c, a12, a22, b, positive, negative, order_key: 0 }
}

/// A vertex whose old neighbours are all fixed.
pub(super) fn alone(a22: Mat<f64>) -> RingChange {
    ring([], [Mat::zeros(0, 0), Mat::zeros(0, 0), Mat::zeros(0, a22.nrows()), a22])
}

/// Springs of stiffness 1, wall – 0 – 1.
pub(super) fn two_springs() -> Mat<f64> {
    mat![[2.0, -1.0], [-1.0, 1.0]]
}

/// The spring 0 – 1 as two of stiffness 2, with `positive` making up what b does not.
pub(super) fn halved_spring() -> RingChange {
    let (k_p, k_c) = (mat![[1.0, -1.0], [-1.0, 1.0]], mat![[2.0, 0.0], [0.0, 2.0]]);
    ring([0, 1], [k_p, k_c, mat![[-2.0], [-2.0]], mat![[4.0]]])
}

/// A vertex that hangs on vertex `slot` by a spring of ½ and stiffens it by `s`².
pub(super) fn hanger(slot: usize, s: f64) -> RingChange {
    let parts = [mat![[0.0]], mat![[0.5 + s * s]], mat![[-1.0]], mat![[2.0]]];
    RingChange { positive: mat![[s]], ..ring([slot], parts) }
}

/// What is added to the rows of some vertices, by its factor.
pub(super) fn stiffer<const R: usize>(slots: [usize; R], added: Mat<f64>) -> StiffnessChange {
    let removed = Mat::zeros(added.nrows(), 0);
    StiffnessChange { slots: slots.into(), added, removed }
}

/// What is removed from the rows of some vertices, by its factor.
pub(super) fn softer<const R: usize>(slots: [usize; R], removed: Mat<f64>) -> StiffnessChange {
    let added = Mat::zeros(removed.nrows(), 0);
    StiffnessChange { slots: slots.into(), added, removed }
}
