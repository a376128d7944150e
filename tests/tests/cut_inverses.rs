//! Inverses follow cuts, their closings, splits and merges; and what is made of a tetrahedron that is cut.

use faer::Mat;
use faer::linalg::solvers::Solve;
use nalgebra::Matrix6;
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::{Change, FineFace, Recast};
use yawara_tests::clamped_body::ClampedBody;
use yawara_tests::cuts::{Cut, by_plane, cuts, parted};
use yawara_tests::organ::{Organ, organs};

/// K kept against K added up element by element, and a load's solution against dense LU: the largest difference of an
/// entry of K relative to its diagonal, ‖S(u − u*)‖ / ‖S u*‖ with S = |diag K|^½.
fn errors(body: &ClampedBody) -> [f64; 2] {
    let k = body.stiffness();
    let kept = body.link.maintainer().stiffness().to_dense();
    let n = k.nrows();
    let is_clamped: Vec<bool> = (0..n).map(|i| (0..n).all(|j| k[(i, j)] == 0.0)).collect();
    let free: Vec<usize> = (0..n).filter(|&i| !is_clamped[i]).collect();
    let scale: Vec<f64> = (0..n).map(|i| k[(i, i)].abs().sqrt()).collect();
    let mut of_k = 0.0;
    for (&i, &j) in free.iter().flat_map(|i| free.iter().map(move |j| (i, j))) {
        of_k = f64::max(of_k, (k[(i, j)] - kept[(i, j)]).abs() / (scale[i] * scale[j]));
    }
    let m = free.len();
    let unit = Mat::from_fn(m, m, |i, j| k[(free[i], free[j])] / scale[free[i]] / scale[free[j]]);
    let load = Mat::from_fn(m, 1, |i, _| (1.7 * i as f64).sin());
    let lu = unit.partial_piv_lu();
    let mut exact = lu.solve(&load);
    exact += lu.solve(&load - &unit * &exact);
    let (mut f, mut u) = (vec![0.0; n], vec![0.0; n]);
    free.iter().enumerate().for_each(|(i, &at)| f[at] = load[(i, 0)] * scale[at]);
    body.link.maintainer().solve(&f, &mut u).unwrap();
    let got = Mat::from_fn(m, 1, |i, _| u[free[i]] * scale[free[i]]);
    let error = (&got - &exact).norm_l2() / exact.norm_l2();
    [of_k, if error.is_nan() { f64::INFINITY } else { error }]
}

fn contrast(mut organ: Organ) -> Organ {
    organ.materials = vec![(1e3, 0.3), (1e6, 0.45), (3e4, 0.4)];
    organ
}

#[derive(Clone, Debug)]
enum Step {
    Mesh(bool, Index),
    Cut(bool, Cut),
}

fn steps(length: usize) -> impl Strategy<Value = Vec<Step>> {
    let mesh = (proptest::bool::weighted(0.6), any::<Index>()).prop_map(|(s, i)| Step::Mesh(s, i));
    let cut = (proptest::bool::weighted(0.7), cuts()).prop_map(|(s, cut)| Step::Cut(s, cut));
    prop::collection::vec(prop_oneof![1 => mesh, 1 => cut], length)
}

/// How many cuts and closings were made, and the errors at the end.
fn run(
    organ: &Organ,
    maintainer: &'static str,
    element: &str,
    steps: &[Step],
) -> (usize, [f64; 2]) {
    let mut body = ClampedBody::new(organ, "laminate", maintainer, element);
    let mut count = 0;
    for step in steps {
        match step {
            Step::Mesh(split, pick) => body.step(&(*split, *pick)),
            Step::Cut(severs, cut) => count += usize::from(body.cut(*severs, *cut)),
        }
    }
    (count, errors(&body))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// The K of the mesh with all its sheets, added up by itself; solutions of every maintainer by dense LU.
    #[test]
    fn every_maintainer_follows_cuts(
        organ in organs([2, 1, 1], 3, 2.0..5.0, 0.0..0.45).prop_map(contrast),
        steps in steps(30),
        element in prop::sample::select(vec!["p1", "p1p1"]),
    ) {
        for maintainer in yawara_inverse_update::CHOICES {
            let (_, [of_k, of_u]) = run(&organ, maintainer, element, &steps);
            prop_assert!(of_k < 1e-12, "{maintainer}, {element}: K off by {of_k:e}");
            prop_assert!(of_u < 1e-8, "{maintainer}, {element}: u off by {of_u:e}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// A cut and its closing leave the matrix that was there, and its inverse.
    #[test]
    fn what_is_closed_is_as_stiff_as_before(splits in prop::collection::vec(any::<Index>(), 12)) {
        let organ = Organ::homogeneous([2, 1, 1], 1e4, 0.3);
        for (maintainer, element) in [("sparse", "p1"), ("woodbury", "p1"), ("sparse", "p1p1")] {
            let mut body = ClampedBody::new(&organ, "laminate", maintainer, element);
            splits.iter().for_each(|pick| body.step(&(true, *pick)));
            let vertices = body.link.maintainer().vertices();
            let before = body.stiffness();
            let cut = ([1, 0, 0], 45, ([45, 16, 0], 30));
            prop_assert!(body.cut(true, cut));
            prop_assert!(body.link.maintainer().vertices() > vertices + 1);
            let is_close = |[of_k, of_u]: [f64; 2]| of_k < 1e-12 && of_u < 1e-10;
            prop_assert!(is_close(errors(&body)), "{maintainer} {element}: {:?}", errors(&body));
            prop_assert!(body.cut(false, cut));
            prop_assert_eq!(body.link.maintainer().vertices(), vertices);
            prop_assert!(is_close(errors(&body)), "{maintainer} {element}: {:?}", errors(&body));
            // Slots may have another order.
            prop_assert!((body.stiffness().norm_l2() - before.norm_l2()).abs() < 1e-12 * before.norm_l2());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Parts of one material count by their volume; of several they are definite, and no stiffer than by volume.
    #[test]
    fn parts_share_the_stiffness_of_the_whole(
        organ in organs([1, 1, 1], 3, 2.0..5.0, 0.0..0.45),
        list in prop::collection::vec(cuts(), 1..4),
        rule in prop::sample::select(vec!["laminate", "linear", "paper"]),
        is_one in any::<bool>(),
    ) {
        let organ = if is_one { Organ::homogeneous([1, 1, 1], 1e4, 0.3) } else { organ };
        let mut forest = organ.forest(2, 6);
        let [mut embedding, mut by_volume] = [rule, "linear"].map(|rule| organ.embedding(rule));
        for (normal, offset, ball) in list {
            let faces = parted(&forest, by_plane(normal, offset / 2, (ball.0.map(|x| x / 2), ball.1)));
            let delta = forest.sever(&faces).unwrap();
            embedding.adopt(forest.tree().clone(), &delta.parts).unwrap();
            by_volume.adopt(forest.tree().clone(), &delta.parts).unwrap();
            prop_assert_eq!(delta.change, Change::Split);
            for Recast { before, after } in &delta.recast {
                let whole = embedding.elasticity(before[0].node);
                let parts: Matrix6<f64> =
                    after.iter().map(|tet| embedding.elasticity(tet.node)).sum();
                let density: f64 = after.iter().map(|tet| embedding.density(tet.node)).sum();
                prop_assert!((density - embedding.density(before[0].node)).abs() < 1e-9);
                if is_one || rule == "linear" {
                    prop_assert!((parts - whole).amax() < 1e-13 * whole.amax(), "{rule}");
                }
                for tet in after.iter().filter(|_| rule != "paper") {
                    let [d, most] = [&embedding, &by_volume].map(|e| e.elasticity(tet.node));
                    let least = d.symmetric_eigenvalues().min();
                    let room = (most - d).symmetric_eigenvalues().min();
                    prop_assert!(least > 0.0 && room > -1e-13 * most.amax(), "{rule}: {least:e} {room:e}");
                }
                for tet in after {
                    let held = (0..1 << (6 - tet.level))
                        .filter(|&i| forest.sheet_with(forest.leaf_of(tet.id), i) == tet.id)
                        .count() as f64;
                    let fraction = held / f64::from(1 << (6 - tet.level));
                    if is_one {
                        let want = embedding.elasticity(forest.tree().root(0, 0)) * fraction;
                        let off = (embedding.elasticity(tet.node) - want).amax() / want.amax();
                        prop_assert!(off < 1e-13, "{off:e}");
                    }
                }
            }
        }
        let open: Vec<FineFace> = forest.severed().map(|severed| severed.face).collect();
        let delta = forest.close(&open).unwrap();
        embedding.adopt(forest.tree().clone(), &delta.parts).unwrap();
        let fresh = organ.embedding(rule);
        for tet in forest.leaves() {
            prop_assert_eq!(embedding.elasticity(tet.node), fresh.elasticity(tet.node));
        }
    }
}
