//! Changes whose result is known by hand: what random histories never reach.

use super::springs::{
    alone, close, halved_spring, hanger, inverse, maintain, maintain_mixed, refused, two_springs,
};
use super::{build, method, residual};
use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, mat};
use yawara_inverse_update::{
    InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, Update, drift,
};

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
        negative: Mat::zeros(1, 0),
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
    assert_eq!(maintainer.batch(&[]), Ok(()));
    assert_eq!(maintainer.batch(&[halved_spring(), again].map(Update::Split)), Ok(()));
    let chain = mat![
        [1.0, 1.0, 1.0, 1.0],
        [1.0, 2.0, 1.5, 1.75],
        [1.0, 1.5, 1.5, 1.5],
        [1.0, 1.75, 1.5, 1.75]
    ];
    close(name, &inverse(&*maintainer), &chain);
}

/// A batch of everything: the halved spring, a softer first one, the merge of the middle and a vertex
/// that comes into the gap's place after it.
pub fn a_batch_is_its_updates_in_turn(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let mut singly = maintain(name, 1, &two_springs()).unwrap();
    let softer = StiffnessChange {
        slots: vec![0],
        added: Mat::zeros(1, 0),
        removed: mat![[0.5_f64.sqrt()]],
    };
    let updates = [
        Update::Split(halved_spring()),
        Update::Split(hanger(1, 0.5)),
        Update::Content(softer.clone()),
        Update::Merge { slot: 2, change: halved_spring() },
        Update::Split(hanger(2, 0.25)),
    ];
    maintainer.batch(&updates).unwrap();
    singly.split(&halved_spring()).unwrap();
    singly.split(&hanger(1, 0.5)).unwrap();
    singly.change(&softer).unwrap();
    assert_eq!(singly.merge(2, &halved_spring()), Ok(Some(3)));
    singly.split(&hanger(2, 0.25)).unwrap();
    assert_eq!(maintainer.vertices(), 4);
    let k = singly.stiffness().to_dense();
    assert_eq!(maintainer.stiffness().to_dense(), k);
    close(name, &inverse(&*maintainer), &k.partial_piv_lu().inverse());
}

/// More splits than are put off at once: K of vertices 0 and 1 is that of springs to the ground,
/// and C of the vertices that hang on them follows by hand.
pub fn a_long_batch_is_its_splits(name: &str) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let change = |i: usize| hanger(i % 2, [0.25, 0.5][usize::from(i.is_multiple_of(3))]);
    let updates: Vec<Update> = (0..150).map(|i| Update::Split(change(i))).collect();
    maintainer.batch(&updates).unwrap();
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
        negative: Mat::zeros(2, 0),
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

/// A spring of h = 2¹² beside one of 1 comes and goes: a C that is hardened has lost ε h of what is
/// left, and as much again when it is softened, ε h² = 4e-9, unless that is corrected by K: then
/// ε h remains.
pub fn a_stiff_spring_comes_and_goes(name: &str) {
    a_stiff_spring(name, 64.0, |maintainer, changes| {
        changes.iter().for_each(|change| maintainer.change(change).unwrap());
    });
}

/// The same as one batch, with the split of the other spring in front: no edit may be taken with
/// others where C gets that much softer.
pub fn a_stiff_spring_comes_and_goes_in_a_batch(name: &str) {
    // Roots of stiffnesses that round in different ways.
    for root in [47.0, 55.0, 57.0, 59.0, 61.0, 63.0, 64.0] {
        a_stiff_spring(name, root, |maintainer, changes| {
            let halved = halved_spring();
            let mut updates = vec![Update::Split(halved.clone())];
            updates.extend(changes.iter().cloned().map(Update::Content));
            maintainer.batch(&updates).unwrap();
            maintainer.merge(2, &halved).unwrap();
        });
    }
}

fn a_stiff_spring(
    name: &str,
    root: f64,
    make: impl Fn(&mut dyn InverseMaintainer, &[StiffnessChange]),
) {
    let mut maintainer = maintain(name, 1, &two_springs()).unwrap();
    let stiff = root * root;
    let spring = |added, removed| StiffnessChange { slots: vec![0], added, removed };
    let (root, none) = (mat![[root]], Mat::zeros(1, 0));
    let both = [spring(root.clone(), none.clone()), spring(none, root)];
    let changes: Vec<StiffnessChange> = both.iter().cycle().take(16).cloned().collect();
    make(maintainer.as_mut(), &changes);
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

/// Twenty vertices change at once by a Aᵀ − b Bᵀ whose first part alone would turn every pressure's
/// sign: a quasi-definite K bears the change as a whole only.
pub fn a_wide_quasi_definite_change_is_one_change(name: &str) {
    let (n, a) = (20, 100.0_f64);
    let own = |u: f64, c: f64, q: f64| {
        Mat::from_fn(2 * n, 2 * n, |i, j| match (i / 2 == j / 2, i % 2, j % 2) {
            (false, ..) => 0.0,
            (true, 0, 0) => u,
            (true, 1, 1) => q,
            _ => c,
        })
    };
    let mut maintainer = maintain_mixed(name, &own(20.0, 0.0, -1.0)).unwrap();
    let column = |u: f64, q: f64| {
        Mat::from_fn(2 * n, n, |i, j| if i / 2 == j { [u, q][i % 2] } else { 0.0 })
    };
    let change = StiffnessChange {
        slots: (0..n).collect(),
        added: column(a.sqrt(), a.sqrt()),
        removed: column(0.0, 2.0 * a.sqrt()),
    };
    maintainer.change(&change).unwrap();
    let (u, c, q) = (20.0 + a, a, -1.0 - 3.0 * a);
    let determinant = u * q - c * c;
    let want = own(q / determinant, -c / determinant, u / determinant);
    // C was of size 1 before, and what is taken off it is rounded to that.
    let error = (inverse(&*maintainer) - want).norm_max();
    assert!(error <= 100.0 * (2.0 * f64::EPSILON + residual(name)), "{name}: {error:e}");
    if residual(name) == 0.0 {
        assert_eq!(maintainer.counts().failed_pivots, 0, "{name}");
    }
}
