//! Vertices that are fixed and freed, by hand.

use faer::{Mat, mat};
use yawara_inverse_update::{InverseError, RingChange};

use super::springs::{Case, softer};

/// Springs of stiffness 1, wall – 0 – 1 – 2.
fn three_springs() -> Mat<f64> {
    mat![[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]]
}

/// A vertex that hangs by a spring of 1 on the vertex in slot 0.
fn hanging(own: f64) -> RingChange {
    RingChange::freed(vec![0], mat![[-1.0]], mat![[own]], 0).unwrap()
}

/// Compliances of what is left of a chain, whichever of its vertices are held, until none is free;
/// then the other way.
pub fn all_vertices_can_be_fixed_one_by_one(name: &str) {
    let mut case = Case::springs(name, &three_springs());
    let middle = RingChange::fixed(case.stiffness(), 1).unwrap();
    assert_eq!((&middle.slots[..], &middle.a12), (&[0, 2][..], &mat![[-1.0], [-1.0]]));
    // The end takes the slot of the middle: two springs on vertex 0, one on the end.
    assert_eq!(case.fix(1), Ok(Some(2)));
    assert_eq!(case.stiffness().to_dense(), mat![[2.0, 0.0], [0.0, 1.0]]);
    case.shows(&mat![[0.5, 0.0], [0.0, 1.0]]);
    // All but one.
    assert_eq!(case.fix(0), Ok(Some(1)));
    let mut u = [0.0];
    case.solve(&[3.0], &mut u).unwrap();
    case.close(&mat![[u[0]]], &mat![[3.0]]);
    // All: an object of no rows, that works.
    assert_eq!(case.fix(0), Ok(None));
    assert_eq!((case.vertices(), case.inverse().shape()), (0, (0, 0)));
    case.solve(&[], &mut []).unwrap();
    let error = case.refuses(|m| m.fix(0));
    assert_eq!(error, InverseError::Slot { slot: 0, limit: 0 });
    // The end, the middle and vertex 0 are freed.
    let end = RingChange::freed(vec![], Mat::zeros(0, 1), mat![[1.0]], 0).unwrap();
    assert_eq!(case.split(&end), Ok(0));
    case.shows(&mat![[1.0]]);
    assert_eq!(case.split(&hanging(2.0)), Ok(1));
    case.shows(&mat![[2.0, 1.0], [1.0, 1.0]]);
    let first = RingChange::freed(vec![1], mat![[-1.0]], mat![[2.0]], 0).unwrap();
    assert_eq!(case.split(&first), Ok(2));
    case.shows(&mat![[3.0, 2.0, 1.0], [2.0, 2.0, 1.0], [1.0, 1.0, 1.0]]);
    assert_eq!(case.counts().rebuilds, 0);
}

/// The same for pairs of a displacement and a pressure: what is left is the block of the other.
pub fn a_quasi_definite_vertex_can_be_fixed_and_freed(name: &str) {
    let k = mat![
        [3.0, 1.0, -1.0, 0.5],
        [1.0, -2.0, 0.5, 0.25],
        [-1.0, 0.5, 2.0, 1.0],
        [0.5, 0.25, 1.0, -1.0]
    ];
    let mut case = Case::mixed(name, &k);
    let whole = case.inverse();
    let change = RingChange::fixed(case.stiffness(), 1).unwrap();
    assert_eq!(case.fix(1), Ok(None));
    // [3, 1; 1, −2]⁻¹ = [2, 1; 1, −3] / 7
    let left = mat![[2.0 / 7.0, 1.0 / 7.0], [1.0 / 7.0, -3.0 / 7.0]];
    case.shows(&left);
    assert_eq!(case.split(&change), Ok(1));
    assert_eq!(case.stiffness().to_dense(), k);
    case.shows(&whole);
    // K C = 1 by hand, as `whole` came from the maintainer itself.
    case.close(&(&k * &whole), &Mat::identity(4, 4));
}

/// A freed part that nothing holds: a wall of its own that becomes free, and one that pushes.
pub fn freeing_what_nothing_holds_is_refused(name: &str) {
    let mut case = Case::springs(name, &mat![[1.0]]);
    // The spring's other end was its only hold; K'' = [1, −1; −1, 1].
    for own in [1.0, 0.5] {
        let error = case.finds_singular(|m| m.split(&hanging(own)));
        assert!(error.to_string().contains("not held"), "{error}");
    }
    // Apart from the rest, coupled to nothing, not even to a wall.
    let apart = RingChange::freed(vec![], Mat::zeros(0, 1), mat![[0.0]], 0).unwrap();
    case.finds_singular(|m| m.split(&apart));
    // The rest goes on.
    case.split(&hanging(2.0)).unwrap();
    case.shows(&mat![[2.0, 1.0], [1.0, 1.0]]);
}

/// A chain cut in two parts of which one is held by nothing, and held again before the cut.
pub fn a_part_cut_loose_is_refused_until_it_is_fixed(name: &str) {
    let mut case = Case::springs(name, &three_springs());
    let cut = softer([0, 1], mat![[1.0], [-1.0]]);
    case.finds_singular(|m| m.change(&cut));
    assert_eq!(case.fix(2), Ok(None));
    case.change(&cut).unwrap();
    case.shows(&mat![[1.0, 0.0], [0.0, 1.0]]);
}

/// Shapes, slots, NaN and infinity in what frees a vertex, before any maintainer sees it.
pub fn wrong_fixings_are_refused(name: &str) {
    let mut case = Case::springs(name, &three_springs());
    for slot in [3, usize::MAX] {
        let error = case.refuses(|m| m.fix(slot));
        assert_eq!(error, InverseError::Slot { slot, limit: 3 });
    }
    for value in [f64::NAN, f64::INFINITY] {
        let parts = [(mat![[value]], mat![[1.0]]), (mat![[1.0]], mat![[value]])];
        for (at, (a12, a22)) in parts.into_iter().enumerate() {
            let error = RingChange::freed(vec![0], a12, a22, 0).unwrap_err();
            let InverseError::NotFinite { what, .. } = error else { panic!("{error}") };
            assert_eq!(what, ["a12", "a22"][at]);
        }
    }
    let skew = mat![[1.0, 0.5], [0.0, 1.0]];
    let error = RingChange::freed(vec![], Mat::zeros(0, 2), skew, 0).unwrap_err();
    assert!(matches!(error, InverseError::Asymmetric { what: "a22", .. }), "{error}");
    let shapes = [(vec![0], 2, 1), (vec![0, 1], 1, 1), (vec![0], 1, 2)];
    for (slots, rows, cols) in shapes {
        let error = RingChange::freed(slots, Mat::zeros(rows, cols), mat![[1.0]], 0).unwrap_err();
        assert!(matches!(error, InverseError::Shape { what: "a12", .. }), "{error}");
    }
    let twice = RingChange::freed(vec![1, 1], Mat::zeros(2, 1), mat![[1.0]], 0).unwrap_err();
    assert_eq!(twice, InverseError::DuplicateSlot(1));
    let far = RingChange::freed(vec![7], mat![[-1.0]], mat![[4.0]], 0).unwrap();
    let error = case.refuses(|m| m.split(&far));
    assert_eq!(error, InverseError::Slot { slot: 7, limit: 3 });
}
