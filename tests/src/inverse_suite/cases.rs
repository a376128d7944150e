//! Hand-made cases: what random histories never reach.

use super::{build, method, residual};
use faer::{Mat, mat};
use yawara_inverse_update::{
    InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, drift,
};

pub(super) type Maintainer = Box<dyn InverseMaintainer>;

/// One matrix of a ring change, to be spoilt.
type Field = fn(&mut RingChange) -> &mut Mat<f64>;

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
fn alone(a22: Mat<f64>) -> RingChange {
    let m = a22.nrows();
    RingChange {
        slots: vec![],
        k_p: Mat::zeros(0, 0),
        k_c: Mat::zeros(0, 0),
        a12: Mat::zeros(0, m),
        a22,
        b: Mat::zeros(0, m),
        positive: Mat::zeros(0, 0),
        order_key: 0,
    }
}

/// Springs of stiffness 1, wall – 0 – 1.
fn two_springs() -> Mat<f64> {
    mat![[2.0, -1.0], [-1.0, 1.0]]
}

/// The spring 0 – 1 as two of stiffness 2, with `positive` making up what b does not.
fn halved_spring() -> RingChange {
    RingChange {
        slots: vec![0, 1],
        k_p: mat![[1.0, -1.0], [-1.0, 1.0]],
        k_c: mat![[2.0, 0.0], [0.0, 2.0]],
        a12: mat![[-2.0], [-2.0]],
        a22: mat![[4.0]],
        b: mat![[0.0], [0.0]],
        positive: Mat::zeros(2, 0),
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

/// One row: C = 1/K.
pub fn a_vertex_alone_is_a_division(name: &str) {
    let maintainer = maintain(name, 1, &mat![[4.0]]).unwrap();
    assert_eq!(maintainer.name(), method(name));
    assert_eq!(inverse(&*maintainer), mat![[0.25]]);
    assert_eq!(drift(&*maintainer, 7, 3), 0.0);
}

/// Zero free vertices: nothing to solve, and a first vertex can come.
pub fn no_vertices_at_the_start(name: &str) {
    let mut maintainer = maintain(name, 2, &Mat::zeros(0, 0)).unwrap();
    assert_eq!(maintainer.vertices(), 0);
    maintainer.solve(&[], &mut []).unwrap();
    assert_eq!(maintainer.columns(&[]).unwrap().shape(), (0, 0));
    assert_eq!(drift(&*maintainer, 0, 8), 0.0);
    maintainer.rebuild().unwrap();
    let error = refused(&mut maintainer, |m| m.merge(0, &alone(mat![[1.0, 0.0], [0.0, 1.0]])));
    assert_eq!(error, InverseError::Slot { slot: 0, limit: 0 });
    assert_eq!(maintainer.split(&alone(mat![[2.0, 0.0], [0.0, 8.0]])), Ok(0));
    close(name, &inverse(&*maintainer), &mat![[0.5, 0.0], [0.0, 0.125]]);
}

/// All old vertices of the ring are fixed: only A22 counts.
pub fn a_vertex_whose_ring_is_fixed(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let before = inverse(&*maintainer);
    assert_eq!(maintainer.split(&alone(mat![[8.0]])), Ok(2));
    close(name, &inverse(&*maintainer), &mat![[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.125]]);
    assert_eq!(maintainer.merge(2, &alone(mat![[8.0]])), Ok(None));
    close(name, &inverse(&*maintainer), &before);
}

/// Compliances of a chain: C_ij = Σ 1/k from the wall to the nearer of i and j.
pub fn a_halved_spring_by_hand(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    assert_eq!(maintainer.split(&halved_spring()), Ok(2));
    let chain = mat![[1.0, 1.0, 1.0], [1.0, 2.0, 1.5], [1.0, 1.5, 1.5]];
    close(name, &inverse(&*maintainer), &chain);
    let mut u = [0.0; 3];
    maintainer.solve(&[0.0, 1.0, 0.0], &mut u).unwrap();
    close(name, &mat![[u[0]], [u[1]], [u[2]]], &mat![[1.0], [2.0], [1.5]]);
    let some = maintainer.columns(&[2, 0, 2]).unwrap();
    close(name, &some, &mat![[1.0, 1.0, 1.0], [1.5, 1.0, 1.5], [1.5, 1.0, 1.5]]);
    // Vertex 0 leaves: its springs 1 and 2 in a row become one of 2/3 to the middle vertex,
    // which moves from slot 2 to slot 0.
    let stretch = RingChange {
        slots: vec![2],
        k_p: mat![[2.0 / 3.0]],
        k_c: mat![[2.0]],
        a12: mat![[-2.0]],
        a22: mat![[3.0]],
        b: mat![[0.0]],
        positive: Mat::zeros(1, 0),
        order_key: 0,
    };
    assert_eq!(maintainer.merge(0, &stretch), Ok(Some(2)));
    close(name, &inverse(&*maintainer), &mat![[1.5, 1.5], [1.5, 2.0]]);
}

/// The halved spring, and the second half halved again, which stands on the first new vertex.
pub fn a_batch_may_stand_on_itself(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let again = RingChange {
        slots: vec![2, 1],
        k_p: mat![[2.0, -2.0], [-2.0, 2.0]],
        k_c: mat![[4.0, 0.0], [0.0, 4.0]],
        a12: mat![[-4.0], [-4.0]],
        a22: mat![[8.0]],
        ..halved_spring()
    };
    assert_eq!(maintainer.split_batch(&[]), Ok(vec![]));
    assert_eq!(maintainer.split_batch(&[halved_spring(), again]), Ok(vec![2, 3]));
    let chain = mat![
        [1.0, 1.0, 1.0, 1.0],
        [1.0, 2.0, 1.5, 1.75],
        [1.0, 1.5, 1.5, 1.5],
        [1.0, 1.75, 1.5, 1.75]
    ];
    close(name, &inverse(&*maintainer), &chain);
}

/// A vertex that hangs on vertex `slot` by a spring of ½ and stiffens it by `s`².
fn hanger(slot: usize, s: f64) -> RingChange {
    RingChange {
        slots: vec![slot],
        k_p: mat![[0.0]],
        k_c: mat![[0.5 + s * s]],
        a12: mat![[-1.0]],
        a22: mat![[2.0]],
        b: mat![[0.0]],
        positive: mat![[s]],
        order_key: 0,
    }
}

/// More splits than are put off at once: K of vertices 0 and 1 is that of springs to the ground,
/// and C of the vertices that hang on them follows by hand.
pub fn a_long_batch_is_its_splits(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let changes: Vec<RingChange> =
        (0..150).map(|i| hanger(i % 2, [0.25, 0.5][usize::from(i % 3 == 0)])).collect();
    assert_eq!(maintainer.split_batch(&changes).unwrap(), (2..152).collect::<Vec<_>>());
    // Every third spring to the ground is ¼, the others are 1/16; 25 of 75 are thirds on each.
    let ground = 25.0 / 4.0 + 50.0 / 16.0;
    let (k00, k11) = (2.0 + ground, 1.0 + ground);
    let determinant = k00 * k11 - 1.0;
    let held = [[k11 / determinant, 1.0 / determinant], [1.0 / determinant, k00 / determinant]];
    let kind = |i: usize| if i < 2 { i } else { i % 2 };
    // A hanger moves by ½ of what it hangs on, and by ½ under a load of its own.
    let factor = |i: usize| if i < 2 { 1.0 } else { 0.5 };
    let want = Mat::from_fn(152, 152, |i, j| {
        let own = if i == j && i >= 2 { 0.5 } else { 0.0 };
        own + factor(i) * factor(j) * held[kind(i)][kind(j)]
    });
    close(name, &inverse(&*maintainer), &want);
}

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
        let batch = [hanger(0, 0.5), hanger(1, 0.5), last.clone(), hanger(0, 0.5)];
        let source = match singly.split(&last) {
            Err(source) => Box::new(source),
            Ok(_) => panic!("this has to be refused"),
        };
        let error = maintainer.split_batch(&batch).unwrap_err();
        let InverseError::Batch { done: 2, source: got } = error else { panic!("{error}") };
        assert_eq!(std::mem::discriminant(&*got), std::mem::discriminant(&*source), "{got}");
        assert_eq!(maintainer.vertices(), 4);
        close(name, &inverse(&*maintainer), &inverse(&*singly));
        assert_eq!(maintainer.stiffness().to_dense(), singly.stiffness().to_dense());
        maintainer = maintain(name, 1, &two_springs()).unwrap();
    }
}

/// From one vertex to none.
pub fn the_only_vertex_can_go(name: &str) {
    let mut maintainer = maintain(name, 1, &mat![[4.0]]).unwrap();
    assert_eq!(maintainer.merge(0, &alone(mat![[4.0]])), Ok(None));
    assert_eq!(maintainer.vertices(), 0);
    assert_eq!(inverse(&*maintainer).shape(), (0, 0));
    maintainer.solve(&[], &mut []).unwrap();
    assert_eq!(maintainer.split(&alone(mat![[2.0]])), Ok(0));
    close(name, &inverse(&*maintainer), &mat![[0.5]]);
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

/// A maintainer of vertices of one displacement and one pressure.
pub(super) fn maintain_mixed(name: &str, k: &Mat<f64>) -> Result<Maintainer, InverseError> {
    let vertices = k.nrows() / 2;
    let mut stiffness = SparseStiffness::quasi_definite(vertices, 2, 1)?;
    stiffness.add(&(0..vertices).collect::<Vec<_>>(), k.as_ref())?;
    build(name, stiffness)
}

/// [a, b; b, −p]⁻¹ = [p, b; b, −a] / (ap + b²), after a change and with a second vertex.
pub fn a_quasi_definite_pair_by_hand(name: &str) {
    let mut maintainer = maintain_mixed(name, &mat![[2.0, 1.0], [1.0, -1.0]]).unwrap();
    close(name, &inverse(&*maintainer), &mat![[1.0 / 3.0, 1.0 / 3.0], [1.0 / 3.0, -2.0 / 3.0]]);
    // b grows by 1: [0, 1; 1, 0] = ½ (1, 1)(1, 1)ᵀ − ½ (1, −1)(1, −1)ᵀ.
    let h = 0.5_f64.sqrt();
    let couple =
        StiffnessChange { slots: vec![0], added: mat![[h], [h]], removed: mat![[h], [-h]] };
    maintainer.change(&couple).unwrap();
    close(name, &inverse(&*maintainer), &(mat![[1.0, 2.0], [2.0, -2.0]] * faer::Scale(1.0 / 6.0)));
    assert_eq!(maintainer.split(&alone(mat![[3.0, 0.0], [0.0, -4.0]])), Ok(1));
    let sixth = 1.0 / 6.0;
    let want = mat![
        [sixth, 2.0 * sixth, 0.0, 0.0],
        [2.0 * sixth, -2.0 * sixth, 0.0, 0.0],
        [0.0, 0.0, 2.0 * sixth, 0.0],
        [0.0, 0.0, 0.0, -0.25]
    ];
    close(name, &inverse(&*maintainer), &want);
    assert_eq!(maintainer.merge(0, &alone(mat![[2.0, 2.0], [2.0, -1.0]])), Ok(Some(1)));
    close(name, &inverse(&*maintainer), &mat![[2.0 * sixth, 0.0], [0.0, -0.25]]);
    assert_eq!(maintainer.counts().rebuilds, 0);
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
            order_key: 0,
        };
        let error = refused(&mut maintainer, |m| m.merge(1, &change));
        assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    }
}

/// Every matrix of a change, one row or column short or long.
pub fn wrong_shapes_are_refused(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let fields: [(&str, Field); 6] = [
        ("k_p", |c| &mut c.k_p),
        ("k_c", |c| &mut c.k_c),
        ("a12", |c| &mut c.a12),
        ("a22", |c| &mut c.a22),
        ("b", |c| &mut c.b),
        ("positive", |c| &mut c.positive),
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
    let fields: [Field; 6] = [
        |c| &mut c.k_p,
        |c| &mut c.k_c,
        |c| &mut c.a12,
        |c| &mut c.a22,
        |c| &mut c.b,
        |c| &mut c.positive,
    ];
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for part in fields {
            let mut good = halved_spring();
            good.positive = Mat::zeros(2, 1);
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
        (vec![1, 1], InverseError::DuplicateSlot { slot: 1 }),
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
    assert_eq!(error, InverseError::OwnRing { slot: 1 });
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

/// After `rebuild` the maintainer is as good as a new one of the same K.
pub fn rebuild_removes_the_drift(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    maintainer.split(&halved_spring()).unwrap();
    let k = maintainer.stiffness().to_dense();
    maintainer.rebuild().unwrap();
    assert_eq!(maintainer.stiffness().to_dense(), k);
    assert_eq!(maintainer.counts().rebuilds, 0, "counts only what the maintainer did by itself");
    assert_eq!(inverse(&*maintainer), inverse(&*maintain(name, 1, &k).unwrap()));
}

/// Removing all but 1e-12 of a spring: no digits are left in an update, all of them in K.
pub fn a_nearly_singular_change_stays_accurate(name: &str) {
    let mut maintainer = maintain(name, 1, &mat![[1.0, 0.0], [0.0, 2.0]]).unwrap();
    let rest = 2.0_f64.powi(-40);
    let removed = 1.0 - rest / 2.0;
    let change =
        StiffnessChange { slots: vec![0], added: Mat::zeros(1, 0), removed: mat![[removed]] };
    // removed² is rounded once, then K is exact.
    let left = 1.0 - removed * removed;
    maintainer.change(&change).unwrap();
    let got = inverse(&*maintainer)[(0, 0)];
    let limit = 4.0 * f64::EPSILON + residual(name);
    assert!((got * left - 1.0).abs() <= limit, "{got} instead of {}", 1.0 / left);
}

/// Displacement and pressure, [A, G; Gᵀ, −P]: a vertex comes in, and goes again.
pub fn a_quasi_definite_vertex_by_hand(name: &str) {
    let mut k = SparseStiffness::quasi_definite(1, 2, 1).unwrap();
    k.add(&[0], mat![[2.0, 2.0], [2.0, -2.0]].as_ref()).unwrap();
    let mut maintainer = build(name, k).unwrap();
    // [2, 2; 2, −2]⁻¹ = [2, 2; 2, −2] / 8
    let first = mat![[0.25, 0.25], [0.25, -0.25]];
    close(name, &inverse(&*maintainer), &first);
    // The body is halved: K_c = K_p, b = 0 and a12 = −Hᵀ A22 with H = ½. Then
    // K'' = [K + HᵀA22H, −HᵀA22; −A22H, A22], whose inverse is [C, CHᵀ; HC, A22⁻¹ + HCHᵀ].
    let a22 = mat![[4.0, 0.0], [0.0, -8.0]];
    let change = RingChange {
        slots: vec![0],
        k_p: Mat::zeros(2, 2),
        k_c: &a22 * faer::Scale(0.25),
        a12: &a22 * faer::Scale(-0.5),
        a22,
        b: Mat::zeros(2, 2),
        positive: Mat::zeros(2, 0),
        order_key: 0,
    };
    assert_eq!(maintainer.split(&change), Ok(1));
    let whole = mat![
        [0.25, 0.25, 0.125, 0.125],
        [0.25, -0.25, 0.125, -0.125],
        [0.125, 0.125, 0.25 + 0.0625, 0.0625],
        [0.125, -0.125, 0.0625, -0.125 - 0.0625]
    ];
    close(name, &inverse(&*maintainer), &whole);
    assert_eq!(maintainer.merge(1, &change), Ok(None));
    close(name, &inverse(&*maintainer), &first);
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

/// A spring of h = 2¹² beside one of 1 comes and goes: a C that is hardened has lost ε h of what is
/// left, and as much again when it is softened, ε h² = 4e-9, unless that is corrected by K: then
/// ε h remains.
pub fn a_stiff_spring_comes_and_goes(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let stiff = 2.0_f64.powi(12);
    let spring = |added, removed| StiffnessChange { slots: vec![0], added, removed };
    let (root, none) = (mat![[stiff.sqrt()]], Mat::zeros(1, 0));
    for _ in 0..8 {
        maintainer.change(&spring(root.clone(), none.clone())).unwrap();
        maintainer.change(&spring(none.clone(), root.clone())).unwrap();
    }
    assert_eq!(maintainer.stiffness().to_dense(), two_springs());
    let error = (inverse(&*maintainer) - mat![[1.0, 1.0], [1.0, 2.0]]).norm_max();
    let per_visit = match name {
        // The paper's order loses what it loses.
        "paper" => 4.0 * stiff * stiff,
        _ => 4.0 * stiff,
    };
    let limit = 8.0 * per_visit * f64::EPSILON + 100.0 * residual(name);
    assert!(error <= limit, "{name}: {error:e}, limit {limit:e}");
    // f32 has no digits left for this, and says so.
    if residual(name) == 0.0 {
        assert_eq!(maintainer.counts().rebuilds, 0);
    }
}
