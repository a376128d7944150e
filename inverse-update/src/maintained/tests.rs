//! Inverses that have drifted: K is changed behind their back, as nothing else makes them drift as
//! far as the monitor asks for.

use faer::Mat;

use super::*;
use crate::accuracy::{DRIFT_LIMIT_F32, residual};
use crate::{Delayed, HostStore, Lu, Paper, Sparse, Woodbury, WoodburyF32, drift};

/// Makes K another one than is inverted, by that fraction in the rows of the first slot.
trait Spoil: InverseMaintainer {
    fn spoil(&mut self, fraction: f64);
}

impl<M: Method> Spoil for Maintained<M> {
    fn spoil(&mut self, fraction: f64) {
        let own = self.stiffness.to_dense().get(..3, ..3) * faer::Scale(fraction);
        self.stiffness.add(&[0], own.as_ref()).unwrap();
    }
}

/// A chain of springs from a wall, three rows per vertex.
fn chain(vertices: usize) -> SparseStiffness {
    let mut k = SparseStiffness::zeros(vertices, 3).unwrap();
    let own = Mat::from_fn(3, 3, |i, j| if i == j { 1.0 + i as f64 } else { 0.25 });
    k.add(&[0], own.as_ref()).unwrap();
    let sign = |i: usize, j: usize| if (i < 3) == (j < 3) { 1.0 } else { -1.0 };
    let spring = Mat::from_fn(6, 6, |i, j| sign(i, j) * own[(i % 3, j % 3)]);
    (1..vertices).for_each(|v| k.add(&[v - 1, v], spring.as_ref()).unwrap());
    k
}

/// A spring on the second slot.
fn stiffer() -> StiffnessChange {
    let (added, removed) = (Mat::from_fn(3, 1, |_, _| 1.0), Mat::zeros(3, 0));
    StiffnessChange { slots: vec![1], added, removed }
}

/// Every maintainer, after an update, with K off by a fraction of its limit; and the limit.
fn spoilt(fraction: f64) -> Vec<(Box<dyn Spoil>, f64)> {
    let mut all: Vec<(Box<dyn Spoil>, f64)> = vec![
        (Box::new(Lu::new(chain(5)).unwrap()), DRIFT_LIMIT),
        (Box::new(Delayed::new(chain(5), HostStore::new()).unwrap()), DRIFT_LIMIT),
        (Box::new(Paper::new(chain(5)).unwrap()), DRIFT_LIMIT),
        (Box::new(Sparse::new(chain(5)).unwrap()), DRIFT_LIMIT),
        (Box::new(Woodbury::new(chain(5)).unwrap()), DRIFT_LIMIT),
        (Box::new(WoodburyF32::new(chain(5)).unwrap()), DRIFT_LIMIT_F32),
    ];
    for (maintainer, limit) in &mut all {
        maintainer.change(&stiffer()).unwrap();
        maintainer.spoil(fraction * *limit);
    }
    all
}

/// ‖K u − f‖ / ‖f‖, scaled.
fn left_by_solve(maintainer: &dyn InverseMaintainer) -> f64 {
    let k = maintainer.stiffness();
    let f: Vec<f64> = (0..k.dofs()).map(|i| 1.0 + (i as f64).sin()).collect();
    let (mut u, mut r) = (vec![0.0; f.len()], vec![0.0; f.len()]);
    maintainer.solve(&f, &mut u).unwrap();
    residual(k, &f, &u, &mut r)
}

#[test]
fn a_spoilt_inverse_is_seen_rebuilt_and_counted() {
    for (mut maintainer, limit) in spoilt(100.0) {
        let name = maintainer.name();
        let seen = maintainer.watch(3).unwrap();
        assert!(seen > limit, "{name}: {seen:e}");
        let counts = maintainer.counts();
        assert_eq!((counts.rebuilds, counts.drift_rebuilds), (1, 1), "{name}");
        assert_eq!(counts.failed_pivots, 0, "{name}");
        // Rounding of a well-conditioned C: 1e-14, and 1e-6 in f32.
        let after = drift(&*maintainer, 3, 4);
        assert!(after < 1e-3 * limit, "{name}: {after:e}");
        assert_eq!(maintainer.counts().rebuilds, 1, "{name}");
        assert!(left_by_solve(&*maintainer) < 1e-12, "{name}");
    }
}

#[test]
fn an_inverse_that_is_hardly_spoilt_is_let_be() {
    for (mut maintainer, limit) in spoilt(1e-3) {
        let name = maintainer.name();
        let seen = maintainer.watch(3).unwrap();
        assert!(0.0 < seen && seen <= limit, "{name}: {seen:e}");
        assert_eq!(maintainer.counts().rebuilds, 0, "{name}");
    }
}

#[test]
fn a_solution_of_a_spoilt_inverse_is_refined_and_counted() {
    for (maintainer, limit) in spoilt(0.5) {
        let name = maintainer.name();
        let left = left_by_solve(&*maintainer);
        let counts = maintainer.counts();
        assert_eq!(counts.rebuilds, 0, "{name}");
        if name == "woodbury_f32" {
            assert!((1..=5).contains(&counts.refinement_steps), "{name}: {counts:?}");
        } else {
            assert_eq!(counts.refinement_steps, 1, "{name}");
        }
        // What C is off by, about the limit times the condition number, twice over.
        assert!(left < 1e-12, "{name} ({limit:e}): {left:e}");
    }
}

/// What one step can't mend is not K's inverse any more, watched or not.
#[test]
fn an_inverse_that_no_longer_solves_is_computed_afresh() {
    for (maintainer, limit) in spoilt(1e-2 / DRIFT_LIMIT) {
        let name = maintainer.name();
        if limit > DRIFT_LIMIT {
            continue;
        }
        assert!(left_by_solve(&*maintainer) < 1e-14, "{name}");
        let counts = maintainer.counts();
        assert_eq!((counts.rebuilds, counts.drift_rebuilds), (1, 0), "{name}");
        assert!(left_by_solve(&*maintainer) < 1e-14, "{name}");
        assert_eq!(maintainer.counts().rebuilds, 1, "{name}");
    }
}

#[test]
fn an_inverse_just_computed_is_not_watched() {
    for (mut maintainer, limit) in spoilt(0.0) {
        let name = maintainer.name();
        maintainer.rebuild().unwrap();
        maintainer.spoil(100.0 * limit);
        assert_eq!(maintainer.watch(3), Ok(0.0), "{name}");
        // Two at once, as one alone is made as `change` makes it; some compute the inverse then.
        maintainer.batch(&[(); 2].map(|()| Update::Content(stiffer()))).unwrap();
        let is_fresh = ["lu", "sparse"].contains(&name);
        assert!(maintainer.watch(3).unwrap() > limit || is_fresh, "{name}");
    }
}

#[test]
fn nothing_is_watched_without_vertices() {
    let mut empty = Woodbury::new(SparseStiffness::zeros(0, 3).unwrap()).unwrap();
    assert_eq!(empty.watch(0), Ok(0.0));
}

#[test]
fn what_is_not_finite_has_drifted_for_ever() {
    let mut maintainer = Woodbury::new(chain(2)).unwrap();
    maintainer.change(&stiffer()).unwrap();
    // The square of what is left overflows.
    maintainer.spoil(1e200);
    assert_eq!(drift(&maintainer, 0, 40), f64::INFINITY);
    let error = maintainer.solve(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], &mut [0.0; 6]).unwrap_err();
    assert!(matches!(error, InverseError::NotFinite { what: "the solution", .. }), "{error}");
    assert!(maintainer.watch(0).unwrap() > 1e150);
    assert!(drift(&maintainer, 0, 40) < 1e-12);
}
