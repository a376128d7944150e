//! What a maintainer has to refuse, and be as before.

use faer::{Mat, mat};
use yawara_inverse_update::{InverseError, RingChange, StiffnessChange, Update};

use super::springs::{Case, alone, halved_spring, hanger, ring, softer, stiffer, two_springs};

/// One matrix of a ring change, to be spoilt.
type Field = fn(&mut RingChange) -> &mut Mat<f64>;

const FIELDS: [(&str, Field); 7] = [
    ("k_p", |c| &mut c.k_p),
    ("k_c", |c| &mut c.k_c),
    ("a12", |c| &mut c.a12),
    ("a22", |c| &mut c.a22),
    ("b", |c| &mut c.b),
    ("positive", |c| &mut c.positive),
    ("negative", |c| &mut c.negative),
];

/// The splits before the refused one are made, and nothing else.
pub fn a_refused_batch_says_how_far_it_came(name: &str) {
    let mut singly = Case::springs(name, &two_springs());
    singly.split(&hanger(0, 0.5)).unwrap();
    singly.split(&hanger(1, 0.5)).unwrap();
    let wrong = RingChange { slots: vec![9], ..hanger(0, 1.0) };
    let pushes = ring([0], [mat![[9.0]], mat![[0.5]], mat![[-1.0]], mat![[2.0]]]);
    let pushes = RingChange { b: mat![[18.0_f64.sqrt()]], ..pushes };
    for last in [wrong, pushes] {
        let mut case = Case::springs(name, &two_springs());
        let all = [hanger(0, 0.5), hanger(1, 0.5), last.clone(), hanger(0, 0.5)];
        let source = singly.split(&last).unwrap_err();
        let error = case.batch(&all.map(Update::Split)).unwrap_err();
        let InverseError::Batch { done: 2, source: got } = error else { panic!("{error}") };
        assert_eq!(std::mem::discriminant(&*got), std::mem::discriminant(&source), "{got}");
        assert_eq!(case.vertices(), 4);
        case.shows(&singly.inverse());
        assert_eq!(case.stiffness().to_dense(), singly.stiffness().to_dense());
    }
}

/// Bodies that nothing holds, zero matrices and indefinite ones have no inverse to keep.
pub fn free_and_indefinite_bodies_are_refused(name: &str) {
    let free = mat![[1.0, -1.0], [-1.0, 1.0]];
    let thirds = Mat::from_fn(6, 6, |i, j| if i == j { 5.0 / 3.0 } else { -1.0 / 3.0 });
    let apart = mat![[2.0, 0.0], [0.0, 0.0]];
    let indefinite = mat![[1.0, 2.0], [2.0, 1.0]];
    for k in [free, thirds, apart, indefinite, mat![[0.0]], mat![[-1.0]]] {
        cannot_start(name, (1, 0), &k);
    }
}

fn cannot_start(name: &str, block: (usize, usize), k: &Mat<f64>) {
    let error = Case::new(name, block, k).err().expect("no such inverse");
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
}

/// Matrices and changes that are regular, but whose pivots have other signs than announced.
pub fn wrong_signs_are_refused(name: &str) {
    let blocks = [mat![[2.0, 0.0], [0.0, 1.0]], mat![[-2.0, 0.0], [0.0, -1.0]]];
    for k in [mat![[2.0, 1.0], [1.0, 1.0]], mat![[-2.0, 1.0], [1.0, -1.0]]].iter().chain(&blocks) {
        cannot_start(name, (2, 1), k);
    }
    let mut case = Case::mixed(name, &mat![[2.0, 1.0], [1.0, -1.0]]);
    for a22 in blocks {
        let error = case.refuses(|m| m.split(&alone(a22)));
        assert!(matches!(error, InverseError::Singular { what: "a22", .. }), "{error}");
    }
    // −p becomes 3, then a becomes −2, then both: the determinants are not 0, their signs are wrong.
    let (pressure, solid) = (mat![[0.0], [2.0]], mat![[2.0], [0.0]]);
    case.finds_singular(|m| m.change(&stiffer([0], pressure.clone())));
    case.finds_singular(|m| m.change(&softer([0], solid.clone())));
    let both = StiffnessChange { added: pressure, ..softer([0], solid) };
    case.finds_singular(|m| m.change(&both));
}

/// Cutting the body loose, or more, leaves the maintainer as it was.
pub fn a_change_to_singular_is_refused(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    for root in [1.0, 1.5, 9.0] {
        case.finds_singular(|m| m.change(&softer([0], mat![[root]])));
    }
    for root in [1.0, 1.1] {
        case.finds_singular(|m| m.change(&softer([1, 0], mat![[root], [-root]])));
    }
    // K' = [−8, −9; −9, −8] has an inverse, and one with a positive diagonal.
    let mut apart = Case::springs(name, &mat![[1.0, 0.0], [0.0, 1.0]]);
    apart.finds_singular(|m| m.change(&softer([0, 1], mat![[3.0], [3.0]])));
    // Taking both signs at once: the positive part comes first, so this is no obstacle.
    let exchange = StiffnessChange { added: mat![[2.0]], ..softer([0], mat![[1.0]]) };
    case.change(&exchange).unwrap();
    case.shows(&mat![[0.25, 0.25], [0.25, 1.25]]);
}

/// A refined ring that pushes: K + M = 1 − 3.
pub fn a_split_to_indefinite_is_refused(name: &str) {
    let mut case = Case::springs(name, &mat![[1.0]]);
    let pushes = ring([0], [mat![[3.0]], mat![[1.0]], mat![[1.0]], mat![[1.0]]]);
    let mut change = RingChange { b: mat![[3.0_f64.sqrt()]], ..pushes };
    case.finds_singular(|m| m.split(&change));
    change.a22 = mat![[-1.0]];
    let error = case.refuses(|m| m.split(&change));
    assert!(matches!(error, InverseError::Singular { what: "a22", .. }), "{error}");
}

/// A coarse ring of stiffness 0, or less, on a vertex that nothing else holds.
pub fn a_merge_to_singular_is_refused(name: &str) {
    let mut case = Case::springs(name, &mat![[2.0, -1.0], [-1.0, 1.0]]);
    for (k_p, f) in [(0.0, 1.0_f64), (-3.0, 2.0)] {
        let without = ring([0], [mat![[k_p]], mat![[2.0]], mat![[-1.0]], mat![[1.0]]]);
        let change = RingChange { positive: mat![[f]], ..without };
        case.finds_singular(|m| m.merge(1, &change));
    }
}

/// Every matrix of a change, one row or column short or long.
pub fn wrong_shapes_are_refused(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    for (field, part) in FIELDS {
        for (rows, cols) in [(0, 0), (3, 1), (1, 3), (3, 3)] {
            let mut change = halved_spring();
            *part(&mut change) = Mat::zeros(rows, cols);
            let error = case.refuses(|m| m.split(&change));
            assert!(matches!(error, InverseError::Shape { what, .. } if what == field), "{error}");
            case.refuses(|m| m.merge(1, &change));
        }
    }
    for (added, removed) in [(3, 2), (2, 1)] {
        let [added, removed] = [added, removed].map(|rows| Mat::zeros(rows, 1));
        let change = StiffnessChange { slots: vec![0, 1], added, removed };
        let error = case.refuses(|m| m.change(&change));
        assert!(matches!(error, InverseError::Shape { .. }), "{error}");
    }
}

/// NaN and infinity in every place of every matrix.
pub fn nan_and_infinity_are_refused(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    let not_finite = |error| assert!(matches!(error, InverseError::NotFinite { .. }), "{error}");
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for (_, part) in FIELDS {
            let (positive, negative) = (Mat::zeros(2, 1), Mat::zeros(2, 1));
            let mut good = RingChange { positive, negative, ..halved_spring() };
            let (rows, cols) = part(&mut good).shape();
            for (row, col) in (0..rows).flat_map(|i| (0..cols).map(move |j| (i, j))) {
                let mut change = good.clone();
                part(&mut change)[(row, col)] = value;
                not_finite(case.refuses(|m| m.split(&change)));
            }
        }
        for (added, removed) in [(value, 0.0), (0.0, value)] {
            let change = StiffnessChange { added: mat![[added]], ..softer([1], mat![[removed]]) };
            not_finite(case.refuses(|m| m.change(&change)));
        }
    }
    // Finite, but not its square.
    not_finite(case.refuses(|m| m.change(&stiffer([1], mat![[1e200]]))));
}

/// Slots that do not exist or come twice.
pub fn wrong_slots_are_refused(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    for (slots, want) in [
        ([0, 2], InverseError::Slot { slot: 2, limit: 2 }),
        ([usize::MAX, 0], InverseError::Slot { slot: usize::MAX, limit: 2 }),
        ([1, 1], InverseError::DuplicateSlot(1)),
    ] {
        let ring = RingChange { slots: slots.into(), ..halved_spring() };
        assert_eq!(case.refuses(|m| m.split(&ring)), want);
        assert_eq!(case.refuses(|m| m.change(&softer(slots, Mat::zeros(2, 0)))), want);
    }
    let error = case.columns(&[0, 2]).unwrap_err();
    assert_eq!(error, InverseError::Slot { slot: 2, limit: 2 });
    let error = case.refuses(|m| m.merge(2, &halved_spring()));
    assert_eq!(error, InverseError::Slot { slot: 2, limit: 2 });
}

/// Parts of a change that do not belong together.
pub fn contradictions_are_refused(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    let forgotten = RingChange { b: mat![[-2.0], [-2.0]], ..halved_spring() };
    let error = case.refuses(|m| m.split(&forgotten));
    assert!(matches!(error, InverseError::Inconsistent { .. }), "{error}");
    let skew = RingChange { k_c: mat![[2.0, 0.1], [0.0, 2.0]], ..halved_spring() };
    let error = case.refuses(|m| m.split(&skew));
    assert!(matches!(error, InverseError::Asymmetric { what: "k_c", .. }), "{error}");
}

/// A vertex in its own ring, one that others lean on, one with another row than claimed.
pub fn a_merge_of_the_wrong_vertex_is_refused(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    case.split(&halved_spring()).unwrap();
    let error = case.refuses(|m| m.merge(1, &halved_spring()));
    assert_eq!(error, InverseError::OwnRing(1));
    assert_eq!(case.split(&alone(mat![[1.0]])), Ok(3));
    case.change(&stiffer([2, 3], mat![[1.0], [-1.0]])).unwrap();
    let error = case.refuses(|m| m.merge(2, &halved_spring()));
    assert_eq!(error, InverseError::NotInRing { slot: 2, other: 3 });
    let error = case.refuses(|m| m.merge(3, &halved_spring()));
    assert_eq!(error, InverseError::NotInRing { slot: 3, other: 2 });
    let apart = softer([2, 3], mat![[1.0], [-1.0]]);
    case.change(&StiffnessChange { added: mat![[1.0], [0.0]], ..apart }).unwrap();
    let error = case.refuses(|m| m.merge(2, &halved_spring()));
    assert!(matches!(error, InverseError::Inconsistent { .. }), "{error}");
}

/// Lengths and finiteness of loads; the answer is not touched on error.
pub fn solve_checks_its_vectors(name: &str) {
    let case = Case::springs(name, &two_springs());
    let mut u = [5.0; 2];
    for f in [vec![1.0], vec![1.0; 3], vec![f64::NAN, 1.0], vec![1.0, f64::INFINITY]] {
        case.solve(&f, &mut u).unwrap_err();
        assert_eq!(u, [5.0; 2]);
    }
    case.solve(&[1.0, 1.0], &mut [0.0; 3]).unwrap_err();
    case.solve(&[0.0, 1.0], &mut u).unwrap();
    case.close(&mat![[u[0]], [u[1]]], &mat![[1.0], [2.0]]);
    for loads in [mat![[1.0]], mat![[1.0, f64::NAN], [0.0, 1.0]]] {
        case.solve_many(loads.as_ref()).unwrap_err();
    }
    assert_eq!(case.solve_many(Mat::<f64>::zeros(2, 0).as_ref()).unwrap().shape(), (2, 0));
    // A spring to the wall and one behind it: u = (f_0 + f_1, f_0 + 2 f_1). More loads than any
    // maintainer takes at a time.
    let loads = Mat::from_fn(2, 21, |i, j| (i + 1) as f64 + j as f64);
    let want = Mat::from_fn(2, 21, |i, j| loads[(0, j)] + (i + 1) as f64 * loads[(1, j)]);
    case.close(&case.solve_many(loads.as_ref()).unwrap(), &want);
}
