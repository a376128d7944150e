//! Small matrices by hand and how maintainers of them are looked at.

use super::{build, residual};
use faer::{Mat, mat};
use yawara_inverse_update::{InverseError, InverseMaintainer, RingChange, SparseStiffness};

pub(super) type Maintainer = Box<dyn InverseMaintainer>;

/// A maintainer of a dense matrix with `block` rows per vertex.
pub(super) fn maintain(name: &str, block: usize, k: &Mat<f64>) -> Result<Maintainer, InverseError> {
    let vertices = k.nrows() / block;
    let mut stiffness = SparseStiffness::zeros(vertices, block)?;
    stiffness.add(&(0..vertices).collect::<Vec<_>>(), k.as_ref())?;
    build(name, stiffness)
}

pub(super) fn inverse(maintainer: &dyn InverseMaintainer) -> Mat<f64> {
    let all: Vec<usize> = (0..maintainer.vertices()).collect();
    maintainer.columns(&all).expect("all slots")
}

/// A vertex whose old neighbours are all fixed.
pub(super) fn alone(a22: Mat<f64>) -> RingChange {
    let m = a22.nrows();
    RingChange {
        slots: vec![],
        k_p: Mat::zeros(0, 0),
        k_c: Mat::zeros(0, 0),
        a12: Mat::zeros(0, m),
        a22,
        b: Mat::zeros(0, m),
        positive: Mat::zeros(0, 0),
        negative: Mat::zeros(0, 0),
        order_key: 0,
    }
}

/// Springs of stiffness 1, wall – 0 – 1.
pub(super) fn two_springs() -> Mat<f64> {
    mat![[2.0, -1.0], [-1.0, 1.0]]
}

/// The spring 0 – 1 as two of stiffness 2, with `positive` making up what b does not.
pub(super) fn halved_spring() -> RingChange {
    RingChange {
        slots: vec![0, 1],
        k_p: mat![[1.0, -1.0], [-1.0, 1.0]],
        k_c: mat![[2.0, 0.0], [0.0, 2.0]],
        a12: mat![[-2.0], [-2.0]],
        a22: mat![[4.0]],
        b: mat![[0.0], [0.0]],
        positive: Mat::zeros(2, 0),
        negative: Mat::zeros(2, 0),
        order_key: 0,
    }
}

/// Runs something that has to fail and proves that nothing has changed, to the last bit.
pub(super) fn refused<T: std::fmt::Debug>(
    maintainer: &mut Maintainer,
    attempt: impl FnOnce(&mut dyn InverseMaintainer) -> Result<T, InverseError>,
) -> InverseError {
    let n = maintainer.stiffness().dofs();
    let f: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64).sin()).collect();
    let state = |maintainer: &Maintainer| {
        let mut u = vec![0.0; n];
        maintainer.solve(&f, &mut u).expect("a finite load");
        let k = maintainer.stiffness().to_dense();
        (u, inverse(&**maintainer), k, maintainer.vertices(), maintainer.counts().rebuilds)
    };
    let before = state(maintainer);
    let error = attempt(&mut **maintainer).expect_err("this has to be refused");
    assert!(state(maintainer) == before, "changed by a refused call: {error}");
    error
}

pub(super) fn close(name: &str, got: &Mat<f64>, want: &Mat<f64>) {
    assert_eq!((got.nrows(), got.ncols()), (want.nrows(), want.ncols()), "{name}");
    // The matrices by hand have condition numbers below 100 and at most 5 rows.
    let limit = 100.0 * (5.0 * f64::EPSILON + residual(name)) * want.norm_max();
    assert!((got - want).norm_max() <= limit, "{name}: {got:?}\nwant {want:?}");
}

/// A maintainer of vertices of one displacement and one pressure.
pub(super) fn maintain_mixed(name: &str, k: &Mat<f64>) -> Result<Maintainer, InverseError> {
    let vertices = k.nrows() / 2;
    let mut stiffness = SparseStiffness::quasi_definite(vertices, 2, 1)?;
    stiffness.add(&(0..vertices).collect::<Vec<_>>(), k.as_ref())?;
    build(name, stiffness)
}

/// A vertex that hangs on vertex `slot` by a spring of ½ and stiffens it by `s`².
pub(super) fn hanger(slot: usize, s: f64) -> RingChange {
    RingChange {
        slots: vec![slot],
        k_p: mat![[0.0]],
        k_c: mat![[0.5 + s * s]],
        a12: mat![[-1.0]],
        a22: mat![[2.0]],
        b: mat![[0.0]],
        positive: mat![[s]],
        negative: Mat::zeros(1, 0),
        order_key: 0,
    }
}
