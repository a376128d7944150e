//! Changes whose result is known by hand: what random histories never reach.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Scale, mat};
use yawara_inverse_update::{InverseError, InverseMaintainer, StiffnessChange, Update, drift};

use super::springs::{Case, alone, halved_spring, hanger, ring, softer, stiffer, two_springs};
use super::{method, residual};

/// One row: C = 1/K.
pub fn a_vertex_alone_is_a_division(name: &str) {
    let case = Case::springs(name, &mat![[4.0]]);
    assert_eq!(case.name(), method(name));
    assert_eq!(case.inverse(), mat![[0.25]]);
    assert_eq!(drift(&*case, 7, 3), 0.0);
}

/// Zero free vertices: nothing to solve, and a first vertex can come.
pub fn no_vertices_at_the_start(name: &str) {
    let mut case = Case::new(name, (2, 0), &Mat::zeros(0, 0)).unwrap();
    assert_eq!(case.vertices(), 0);
    case.solve(&[], &mut []).unwrap();
    assert_eq!(case.columns(&[]).unwrap().shape(), (0, 0));
    assert_eq!(drift(&*case, 0, 8), 0.0);
    case.rebuild().unwrap();
    let error = case.refuses(|m| m.merge(0, &alone(mat![[1.0, 0.0], [0.0, 1.0]])));
    assert_eq!(error, InverseError::Slot { slot: 0, limit: 0 });
    assert_eq!(case.split(&alone(mat![[2.0, 0.0], [0.0, 8.0]])), Ok(0));
    case.shows(&mat![[0.5, 0.0], [0.0, 0.125]]);
}

/// All old vertices of the ring are fixed: only A22 counts.
pub fn a_vertex_whose_ring_is_fixed(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    let before = case.inverse();
    assert_eq!(case.split(&alone(mat![[8.0]])), Ok(2));
    case.shows(&mat![[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.125]]);
    assert_eq!(case.merge(2, &alone(mat![[8.0]])), Ok(None));
    case.shows(&before);
}

/// Compliances of a chain: C_ij = Σ 1/k from the wall to the nearer of i and j.
pub fn a_halved_spring_by_hand(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    assert_eq!(case.split(&halved_spring()), Ok(2));
    case.shows(&mat![[1.0, 1.0, 1.0], [1.0, 2.0, 1.5], [1.0, 1.5, 1.5]]);
    let mut u = [0.0; 3];
    case.solve(&[0.0, 1.0, 0.0], &mut u).unwrap();
    case.close(&mat![[u[0]], [u[1]], [u[2]]], &mat![[1.0], [2.0], [1.5]]);
    let some = case.columns(&[2, 0, 2]).unwrap();
    case.close(&some, &mat![[1.0, 1.0, 1.0], [1.5, 1.0, 1.5], [1.5, 1.0, 1.5]]);
    // Vertex 0 leaves: its springs 1 and 2 in a row become one of 2/3 to the middle vertex,
    // which moves from slot 2 to slot 0.
    let stretch = ring([2], [mat![[2.0 / 3.0]], mat![[2.0]], mat![[-2.0]], mat![[3.0]]]);
    assert_eq!(case.merge(0, &stretch), Ok(Some(2)));
    case.shows(&mat![[1.5, 1.5], [1.5, 2.0]]);
}

/// The halved spring, and the second half halved again, which stands on the first new vertex.
pub fn a_batch_may_stand_on_itself(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    let (k_p, k_c) = (mat![[2.0, -2.0], [-2.0, 2.0]], mat![[4.0, 0.0], [0.0, 4.0]]);
    let again = ring([2, 1], [k_p, k_c, mat![[-4.0], [-4.0]], mat![[8.0]]]);
    assert_eq!(case.batch(&[]), Ok(()));
    assert_eq!(case.batch(&[halved_spring(), again].map(Update::Split)), Ok(()));
    case.shows(&mat![
        [1.0, 1.0, 1.0, 1.0],
        [1.0, 2.0, 1.5, 1.75],
        [1.0, 1.5, 1.5, 1.5],
        [1.0, 1.75, 1.5, 1.75]
    ]);
}

/// A batch of everything: the halved spring, a softer first one, the merge of the middle and a vertex
/// that comes into the gap's place after it.
pub fn a_batch_is_its_updates_in_turn(name: &str) {
    let [mut case, mut singly] = [(); 2].map(|()| Case::springs(name, &two_springs()));
    let updates = [
        Update::Split(halved_spring()),
        Update::Split(hanger(1, 0.5)),
        Update::Content(softer([0], mat![[0.5_f64.sqrt()]])),
        Update::Merge { slot: 2, change: halved_spring() },
        Update::Split(hanger(2, 0.25)),
    ];
    case.batch(&updates).unwrap();
    updates[..3].iter().for_each(|update| update.make(&mut *singly).unwrap());
    assert_eq!(singly.merge(2, &halved_spring()), Ok(Some(3)));
    updates[4].make(&mut *singly).unwrap();
    assert_eq!(case.vertices(), 4);
    let k = singly.stiffness().to_dense();
    assert_eq!(case.stiffness().to_dense(), k);
    case.shows(&k.partial_piv_lu().inverse());
}

/// More splits than are put off at once: K of vertices 0 and 1 is that of springs to the ground,
/// and C of the vertices that hang on them follows by hand.
pub fn a_long_batch_is_its_splits(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    let change = |i: usize| hanger(i % 2, if i.is_multiple_of(3) { 0.5 } else { 0.25 });
    let updates: Vec<Update> = (0..150).map(|i| Update::Split(change(i))).collect();
    case.batch(&updates).unwrap();
    // Every third spring to the ground is ¼, the others are 1/16; 25 of 75 are thirds on each.
    let ground = 25.0 / 4.0 + 50.0 / 16.0;
    let (k00, k11) = (2.0 + ground, 1.0 + ground);
    let determinant = k00 * k11 - 1.0;
    let held = [[k11 / determinant, 1.0 / determinant], [1.0 / determinant, k00 / determinant]];
    // Vertices 0 and 1 lie before 150 others. A hanger moves by ½ of what it hangs on, and by ½
    // under a load of its own.
    let factor = |i: usize| if i < 2 { 1.0 } else { 0.5 };
    case.shows(&Mat::from_fn(152, 152, |i, j| {
        let own = if i == j && i >= 2 { 0.5 } else { 0.0 };
        own + factor(i) * factor(j) * held[i % 2][j % 2]
    }));
}

/// From one vertex to none.
pub fn the_only_vertex_can_go(name: &str) {
    let mut case = Case::springs(name, &mat![[4.0]]);
    assert_eq!(case.merge(0, &alone(mat![[4.0]])), Ok(None));
    assert_eq!(case.vertices(), 0);
    assert_eq!(case.inverse().shape(), (0, 0));
    case.solve(&[], &mut []).unwrap();
    assert_eq!(case.split(&alone(mat![[2.0]])), Ok(0));
    case.shows(&mat![[0.5]]);
}

/// [a, b; b, −p]⁻¹ = [p, b; b, −a] / (ap + b²), after a change and with a second vertex.
pub fn a_quasi_definite_pair_by_hand(name: &str) {
    let mut case = Case::mixed(name, &mat![[2.0, 1.0], [1.0, -1.0]]);
    case.shows(&mat![[1.0 / 3.0, 1.0 / 3.0], [1.0 / 3.0, -2.0 / 3.0]]);
    // b grows by 1: [0, 1; 1, 0] = ½ (1, 1)(1, 1)ᵀ − ½ (1, −1)(1, −1)ᵀ.
    let h = 0.5_f64.sqrt();
    let couple = StiffnessChange { removed: mat![[h], [-h]], ..stiffer([0], mat![[h], [h]]) };
    case.change(&couple).unwrap();
    case.shows(&(mat![[1.0, 2.0], [2.0, -2.0]] * Scale(1.0 / 6.0)));
    assert_eq!(case.split(&alone(mat![[3.0, 0.0], [0.0, -4.0]])), Ok(1));
    let sixth = 1.0 / 6.0;
    case.shows(&mat![
        [sixth, 2.0 * sixth, 0.0, 0.0],
        [2.0 * sixth, -2.0 * sixth, 0.0, 0.0],
        [0.0, 0.0, 2.0 * sixth, 0.0],
        [0.0, 0.0, 0.0, -0.25]
    ]);
    assert_eq!(case.merge(0, &alone(mat![[2.0, 2.0], [2.0, -1.0]])), Ok(Some(1)));
    case.shows(&mat![[2.0 * sixth, 0.0], [0.0, -0.25]]);
    assert_eq!(case.counts().rebuilds, 0);
}

/// After `rebuild` the maintainer is as good as a new one of the same K.
pub fn rebuild_removes_the_drift(name: &str) {
    let mut case = Case::springs(name, &two_springs());
    case.split(&halved_spring()).unwrap();
    let k = case.stiffness().to_dense();
    case.rebuild().unwrap();
    assert_eq!(case.stiffness().to_dense(), k);
    assert_eq!(case.counts().rebuilds, 0, "counts only what the maintainer did by itself");
    assert_eq!(case.inverse(), Case::springs(name, &k).inverse());
}

/// Removing all but 1e-12 of a spring: no digits are left in an update, all of them in K.
pub fn a_nearly_singular_change_stays_accurate(name: &str) {
    let mut case = Case::springs(name, &mat![[1.0, 0.0], [0.0, 2.0]]);
    let rest = 2.0_f64.powi(-40);
    let removed = 1.0 - rest / 2.0;
    // removed² is rounded once, then K is exact.
    let left = 1.0 - removed * removed;
    case.change(&softer([0], mat![[removed]])).unwrap();
    let got = case.inverse()[(0, 0)];
    let limit = 4.0 * f64::EPSILON + residual(name);
    assert!((got * left - 1.0).abs() <= limit, "{got} instead of {}", 1.0 / left);
}

/// Displacement and pressure, [A, G; Gᵀ, −P]: a vertex comes in, and goes again.
pub fn a_quasi_definite_vertex_by_hand(name: &str) {
    let mut case = Case::mixed(name, &mat![[2.0, 2.0], [2.0, -2.0]]);
    // [2, 2; 2, −2]⁻¹ = [2, 2; 2, −2] / 8
    let first = mat![[0.25, 0.25], [0.25, -0.25]];
    case.shows(&first);
    // The body is halved: K_c = K_p, b = 0 and a12 = −Hᵀ A22 with H = ½. Then
    // K'' = [K + HᵀA22H, −HᵀA22; −A22H, A22], whose inverse is [C, CHᵀ; HC, A22⁻¹ + HCHᵀ].
    let a22 = mat![[4.0, 0.0], [0.0, -8.0]];
    let (k_c, a12) = (&a22 * Scale(0.25), &a22 * Scale(-0.5));
    let change = ring([0], [Mat::zeros(2, 2), k_c, a12, a22]);
    assert_eq!(case.split(&change), Ok(1));
    case.shows(&mat![
        [0.25, 0.25, 0.125, 0.125],
        [0.25, -0.25, 0.125, -0.125],
        [0.125, 0.125, 0.25 + 0.0625, 0.0625],
        [0.125, -0.125, 0.0625, -0.125 - 0.0625]
    ]);
    assert_eq!(case.merge(1, &change), Ok(None));
    case.shows(&first);
}

/// A spring of h = 2¹² beside one of 1 comes and goes: a C that is hardened has lost ε h of what is
/// left, and as much again when it is softened, ε h² = 4e-9, unless that is corrected by K: then
/// ε h remains.
pub fn a_stiff_spring_comes_and_goes(name: &str) {
    a_stiff_spring(name, 64.0, |maintainer, changes| {
        changes.iter().for_each(|change| change.make(maintainer).unwrap());
    });
}

/// The same as one batch, with the split of the other spring in front: no edit may be taken with
/// others where C gets that much softer.
pub fn a_stiff_spring_comes_and_goes_in_a_batch(name: &str) {
    // Roots of stiffnesses that round in different ways.
    for root in [47.0, 55.0, 57.0, 59.0, 61.0, 63.0, 64.0] {
        a_stiff_spring(name, root, |maintainer, changes| {
            let split = [Update::Split(halved_spring())];
            maintainer.batch(&[&split[..], changes].concat()).unwrap();
            maintainer.merge(2, &halved_spring()).unwrap();
        });
    }
}

fn a_stiff_spring(name: &str, root: f64, make: impl Fn(&mut dyn InverseMaintainer, &[Update])) {
    let mut case = Case::springs(name, &two_springs());
    let root_only = mat![[root]];
    let both = [stiffer([0], root_only.clone()), softer([0], root_only)].map(Update::Content);
    make(&mut *case, &[&both[..]; 8].concat());
    assert_eq!(case.stiffness().to_dense(), two_springs());
    let error = (case.inverse() - mat![[1.0, 1.0], [1.0, 2.0]]).norm_l2();
    let stiff = root * root;
    // The paper's order loses what it loses.
    let per_visit = if name == "paper" { 4.0 * stiff * stiff } else { 4.0 * stiff };
    let limit = 8.0 * per_visit * f64::EPSILON + 100.0 * residual(name);
    assert!(error <= limit, "{name}: {error:e}, limit {limit:e}");
    // f32 has no digits left for this, and says so.
    if residual(name) == 0.0 {
        assert_eq!(case.counts().rebuilds, 0);
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
    let mut case = Case::mixed(name, &own(20.0, 0.0, -1.0));
    let column = |u: f64, q: f64| {
        Mat::from_fn(2 * n, n, |i, j| if i / 2 == j { [u, q][i % 2] } else { 0.0 })
    };
    let (added, removed) = (column(a.sqrt(), a.sqrt()), column(0.0, 2.0 * a.sqrt()));
    case.change(&StiffnessChange { slots: (0..n).collect(), added, removed }).unwrap();
    let (u, c, q) = (20.0 + a, a, -1.0 - 3.0 * a);
    let determinant = u * q - c * c;
    let want = own(q / determinant, -c / determinant, u / determinant);
    // C was of size 1 before, and what is taken off it is rounded to that.
    let error = (case.inverse() - want).norm_max();
    assert!(error <= 100.0 * (2.0 * f64::EPSILON + residual(name)), "{name}: {error:e}");
    if residual(name) == 0.0 {
        assert_eq!(case.counts().failed_pivots, 0, "{name}");
    }
}
