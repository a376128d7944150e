//! What a maintainer has to refuse, and be as before.

use super::build;
use super::springs::{
    alone, close, halved_spring, hanger, inverse, maintain, maintain_mixed, refused, two_springs,
};
use faer::{Mat, mat};
use yawara_inverse_update::{InverseError, RingChange, SparseStiffness, StiffnessChange, Update};

/// One matrix of a ring change, to be spoilt.
type Field = fn(&mut RingChange) -> &mut Mat<f64>;

/// The splits before the refused one are made, and nothing else.
pub fn a_refused_batch_says_how_far_it_came(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let mut singly = maintain(name, 1, &two_springs()).unwrap();
    singly.split(&hanger(0, 0.5)).unwrap();
    singly.split(&hanger(1, 0.5)).unwrap();
    let wrong = RingChange { slots: vec![9], ..hanger(0, 1.0) };
    let pushes = RingChange { k_p: mat![[9.0]], positive: mat![[0.0]], ..hanger(0, 0.0) };
    let pushes = RingChange { k_c: mat![[0.5]], b: mat![[18.0_f64.sqrt()]], ..pushes };
    for last in [wrong, pushes] {
        let all = [hanger(0, 0.5), hanger(1, 0.5), last.clone(), hanger(0, 0.5)];
        let source = match singly.split(&last) {
            Err(source) => Box::new(source),
            Ok(_) => panic!("this has to be refused"),
        };
        let error = maintainer.batch(&all.map(Update::Split)).unwrap_err();
        let InverseError::Batch { done: 2, source: got } = error else { panic!("{error}") };
        assert_eq!(std::mem::discriminant(&*got), std::mem::discriminant(&*source), "{got}");
        assert_eq!(maintainer.vertices(), 4);
        close(name, &inverse(&*maintainer), &inverse(&*singly));
        assert_eq!(maintainer.stiffness().to_dense(), singly.stiffness().to_dense());
        maintainer = maintain(name, 1, &two_springs()).unwrap();
    }
}

/// Bodies that nothing holds, zero matrices and indefinite ones have no inverse to keep.
pub fn free_and_indefinite_bodies_are_refused(name: &str) {
    let free = mat![[1.0, -1.0], [-1.0, 1.0]];
    let thirds = Mat::from_fn(6, 6, |i, j| if i == j { 5.0 / 3.0 } else { -1.0 / 3.0 });
    let apart = mat![[2.0, 0.0], [0.0, 0.0]];
    let indefinite = mat![[1.0, 2.0], [2.0, 1.0]];
    for k in [free, thirds, apart, indefinite, mat![[0.0]], mat![[-1.0]]] {
        let error = maintain(name, 1, &k).err().expect("no inverse");
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    }
}

/// Matrices and changes that are regular, but whose pivots have other signs than announced.
pub fn a_wrong_signature_is_refused(name: &str) {
    for k in [mat![[2.0, 1.0], [1.0, 1.0]], mat![[-2.0, 1.0], [1.0, -1.0]]] {
        let error = maintain_mixed(name, &k).err().expect("another signature");
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    }
    let mut maintainer = maintain_mixed(name, &mat![[2.0, 1.0], [1.0, -1.0]]).unwrap();
    // −p becomes 3, then a becomes −2: the determinants are not 0, their signs are wrong.
    let pressure =
        StiffnessChange { slots: vec![0], added: mat![[0.0], [2.0]], removed: Mat::zeros(2, 0) };
    let solid =
        StiffnessChange { slots: vec![0], added: Mat::zeros(2, 0), removed: mat![[2.0], [0.0]] };
    for change in [pressure, solid] {
        let error = refused(&mut maintainer, |m| m.change(&change));
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    }
    let error = refused(&mut maintainer, |m| m.split(&alone(mat![[1.0, 0.0], [0.0, 1.0]])));
    assert!(matches!(error, InverseError::Singular { what: "a22", .. }), "{error}");
}

/// Cutting the body loose, or more, leaves the maintainer as it was.
pub fn a_change_to_singular_is_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let cut = |removed| StiffnessChange { slots: vec![0], added: Mat::zeros(1, 0), removed };
    let spring = |s: f64| StiffnessChange {
        slots: vec![1, 0],
        added: Mat::zeros(2, 0),
        removed: mat![[s], [-s]],
    };
    for change in [cut(mat![[1.0]]), cut(mat![[1.5]]), cut(mat![[9.0]]), spring(1.0), spring(1.1)] {
        let error = refused(&mut maintainer, |m| m.change(&change));
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    }
    // K' = [−8, −9; −9, −8] has an inverse, and one with a positive diagonal.
    let mut apart = maintain(name, 1, &mat![[1.0, 0.0], [0.0, 1.0]]).unwrap();
    let both =
        StiffnessChange { slots: vec![0, 1], added: Mat::zeros(2, 0), removed: mat![[3.0], [3.0]] };
    let error = refused(&mut apart, |m| m.change(&both));
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    // Taking both signs at once: the positive part comes first, so this is no obstacle.
    let exchange = StiffnessChange { slots: vec![0], added: mat![[2.0]], removed: mat![[1.0]] };
    maintainer.change(&exchange).unwrap();
    close(name, &inverse(&*maintainer), &mat![[0.25, 0.25], [0.25, 1.25]]);
}

/// A refined ring that pushes: K + M = 1 − 3.
pub fn a_split_to_indefinite_is_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &mat![[1.0]]).unwrap();
    let mut change = RingChange {
        slots: vec![0],
        k_p: mat![[3.0]],
        k_c: mat![[1.0]],
        a12: mat![[1.0]],
        a22: mat![[1.0]],
        b: mat![[3.0_f64.sqrt()]],
        positive: Mat::zeros(1, 0),
        negative: Mat::zeros(1, 0),
        order_key: 0,
    };
    let error = refused(&mut maintainer, |m| m.split(&change));
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    change.a22 = mat![[-1.0]];
    let error = refused(&mut maintainer, |m| m.split(&change));
    assert!(matches!(error, InverseError::Singular { what: "a22", .. }), "{error}");
}

/// A coarse ring of stiffness 0, or less, on a vertex that nothing else holds.
pub fn a_merge_to_singular_is_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &mat![[2.0, -1.0], [-1.0, 1.0]]).unwrap();
    for (k_p, f) in [(0.0, 1.0_f64), (-3.0, 2.0)] {
        let change = RingChange {
            slots: vec![0],
            k_p: mat![[k_p]],
            k_c: mat![[2.0]],
            a12: mat![[-1.0]],
            a22: mat![[1.0]],
            b: mat![[0.0]],
            positive: mat![[f]],
            negative: Mat::zeros(1, 0),
            order_key: 0,
        };
        let error = refused(&mut maintainer, |m| m.merge(1, &change));
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    }
}

/// Every matrix of a change, one row or column short or long.
pub fn wrong_shapes_are_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let fields: [(&str, Field); 7] = [
        ("k_p", |c| &mut c.k_p),
        ("k_c", |c| &mut c.k_c),
        ("a12", |c| &mut c.a12),
        ("a22", |c| &mut c.a22),
        ("b", |c| &mut c.b),
        ("positive", |c| &mut c.positive),
        ("negative", |c| &mut c.negative),
    ];
    for (field, part) in fields {
        for (rows, cols) in [(0, 0), (3, 1), (1, 3), (3, 3)] {
            let mut change = halved_spring();
            *part(&mut change) = Mat::zeros(rows, cols);
            let error = refused(&mut maintainer, |m| m.split(&change));
            assert!(matches!(error, InverseError::Shape { what, .. } if what == field), "{error}");
            refused(&mut maintainer, |m| m.merge(1, &change));
        }
    }
    for (added, removed) in [(3, 2), (2, 1)] {
        let change = StiffnessChange {
            slots: vec![0, 1],
            added: Mat::zeros(added, 1),
            removed: Mat::zeros(removed, 1),
        };
        let error = refused(&mut maintainer, |m| m.change(&change));
        assert!(matches!(error, InverseError::Shape { .. }), "{error}");
    }
}

/// NaN and infinity in every place of every matrix.
pub fn nan_and_infinity_are_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let fields: [Field; 7] = [
        |c| &mut c.k_p,
        |c| &mut c.k_c,
        |c| &mut c.a12,
        |c| &mut c.a22,
        |c| &mut c.b,
        |c| &mut c.positive,
        |c| &mut c.negative,
    ];
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for part in fields {
            let mut good = halved_spring();
            good.positive = Mat::zeros(2, 1);
            good.negative = Mat::zeros(2, 1);
            let (rows, cols) = part(&mut good).shape();
            for (row, col) in (0..rows).flat_map(|i| (0..cols).map(move |j| (i, j))) {
                let mut change = good.clone();
                part(&mut change)[(row, col)] = value;
                let error = refused(&mut maintainer, |m| m.split(&change));
                assert!(matches!(error, InverseError::NotFinite { .. }), "{error}");
            }
        }
        for (added, removed) in [(value, 0.0), (0.0, value)] {
            let change =
                StiffnessChange { slots: vec![1], added: mat![[added]], removed: mat![[removed]] };
            let error = refused(&mut maintainer, |m| m.change(&change));
            assert!(matches!(error, InverseError::NotFinite { .. }), "{error}");
        }
    }
    // Finite, but not its square.
    let change =
        StiffnessChange { slots: vec![1], added: mat![[1e200]], removed: Mat::zeros(1, 0) };
    let error = refused(&mut maintainer, |m| m.change(&change));
    assert!(matches!(error, InverseError::NotFinite { .. }), "{error}");
}

/// Slots that do not exist or come twice.
pub fn wrong_slots_are_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    for (slots, want) in [
        (vec![0, 2], InverseError::Slot { slot: 2, limit: 2 }),
        (vec![usize::MAX, 0], InverseError::Slot { slot: usize::MAX, limit: 2 }),
        (vec![1, 1], InverseError::DuplicateSlot(1)),
    ] {
        let ring = RingChange { slots: slots.clone(), ..halved_spring() };
        assert_eq!(refused(&mut maintainer, |m| m.split(&ring)), want);
        let none = Mat::zeros(2, 0);
        let change = StiffnessChange { slots, added: none.clone(), removed: none };
        assert_eq!(refused(&mut maintainer, |m| m.change(&change)), want);
    }
    let error = maintainer.columns(&[0, 2]).unwrap_err();
    assert_eq!(error, InverseError::Slot { slot: 2, limit: 2 });
    let error = refused(&mut maintainer, |m| m.merge(2, &halved_spring()));
    assert_eq!(error, InverseError::Slot { slot: 2, limit: 2 });
}

/// Parts of a change that do not belong together.
pub fn contradictions_are_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let mut forgotten = halved_spring();
    forgotten.b = mat![[-2.0], [-2.0]];
    let error = refused(&mut maintainer, |m| m.split(&forgotten));
    assert!(matches!(error, InverseError::Inconsistent { .. }), "{error}");
    let mut skew = halved_spring();
    skew.k_c = mat![[2.0, 0.1], [0.0, 2.0]];
    let error = refused(&mut maintainer, |m| m.split(&skew));
    assert!(matches!(error, InverseError::Asymmetric { what: "k_c", .. }), "{error}");
}

/// A vertex in its own ring, one that others lean on, one with another row than claimed.
pub fn a_merge_of_the_wrong_vertex_is_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    maintainer.split(&halved_spring()).unwrap();
    let error = refused(&mut maintainer, |m| m.merge(1, &halved_spring()));
    assert_eq!(error, InverseError::OwnRing(1));
    assert_eq!(maintainer.split(&alone(mat![[1.0]])), Ok(3));
    let spring = mat![[1.0], [-1.0]];
    let lean = StiffnessChange { slots: vec![2, 3], added: spring, removed: Mat::zeros(2, 0) };
    maintainer.change(&lean).unwrap();
    let error = refused(&mut maintainer, |m| m.merge(2, &halved_spring()));
    assert_eq!(error, InverseError::NotInRing { slot: 2, other: 3 });
    let error = refused(&mut maintainer, |m| m.merge(3, &halved_spring()));
    assert!(matches!(error, InverseError::NotInRing { slot: 3, other: 2 }), "{error}");
    let stiffer = StiffnessChange {
        slots: vec![2, 3],
        added: mat![[1.0], [0.0]],
        removed: mat![[1.0], [-1.0]],
    };
    maintainer.change(&stiffer).unwrap();
    let error = refused(&mut maintainer, |m| m.merge(2, &halved_spring()));
    assert!(matches!(error, InverseError::Inconsistent { .. }), "{error}");
}

/// Lengths and finiteness of loads; the answer is not touched on error.
pub fn solve_checks_its_vectors(name: &str) {
    let maintainer = maintain(name, 1, &two_springs()).unwrap();
    let mut u = [5.0; 2];
    for f in [vec![1.0], vec![1.0; 3], vec![f64::NAN, 1.0], vec![1.0, f64::INFINITY]] {
        maintainer.solve(&f, &mut u).unwrap_err();
        assert_eq!(u, [5.0; 2]);
    }
    maintainer.solve(&[1.0, 1.0], &mut [0.0; 3]).unwrap_err();
    maintainer.solve(&[0.0, 1.0], &mut u).unwrap();
    close(name, &mat![[u[0]], [u[1]]], &mat![[1.0], [2.0]]);
    for loads in [mat![[1.0]], mat![[1.0, f64::NAN], [0.0, 1.0]]] {
        maintainer.solve_many(loads.as_ref()).unwrap_err();
    }
    assert_eq!(maintainer.solve_many(Mat::<f64>::zeros(2, 0).as_ref()).unwrap().shape(), (2, 0));
    // A spring to the wall and one behind it: u = (f_0 + f_1, f_0 + 2 f_1). More loads than any
    // maintainer takes at a time.
    let loads = Mat::from_fn(2, 21, |i, j| (i + 1) as f64 + j as f64);
    let want = Mat::from_fn(2, 21, |i, j| loads[(0, j)] + (i + 1) as f64 * loads[(1, j)]);
    close(name, &maintainer.solve_many(loads.as_ref()).unwrap(), &want);
}

/// Blocks that are not what the matrix announces, at the start and later.
pub fn wrong_signs_are_refused(name: &str) {
    for wrong in [mat![[2.0, 0.0], [0.0, 1.0]], mat![[-2.0, 0.0], [0.0, -1.0]]] {
        let mut k = SparseStiffness::quasi_definite(1, 2, 1).unwrap();
        k.add(&[0], wrong.as_ref()).unwrap();
        let error = build(name, k).err().expect("another inertia");
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
        let mut k = SparseStiffness::quasi_definite(1, 2, 1).unwrap();
        k.add(&[0], mat![[1.0, 0.0], [0.0, -1.0]].as_ref()).unwrap();
        let mut maintainer = build(name, k).unwrap();
        let error = refused(&mut maintainer, |m| m.split(&alone(wrong.clone())));
        assert!(matches!(error, InverseError::Singular { what: "a22", .. }), "{error}");
        // Both diagonals pass 0 on the way to these.
        let change = StiffnessChange {
            slots: vec![0],
            added: mat![[0.0], [2.0]],
            removed: mat![[2.0], [0.0]],
        };
        let error = refused(&mut maintainer, |m| m.change(&change));
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    }
}
