//! Maintainers on the mixed element: real meshes refined and coarsened at random against a direct
//! assembly, and the signs of what is maintained.

use faer::{Mat, Side};
use nalgebra::DMatrix;
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::RngSeed;
use yawara_tests::mixed_body::MixedBody;
use yawara_tests::organ::{Organ, organs};

/// Splits and merges, a little more of the former: the mesh grows to some 150 vertices.
fn history(length: usize) -> impl Strategy<Value = Vec<(bool, Index)>> {
    proptest::collection::vec((proptest::bool::weighted(0.54), any::<Index>()), length)
}

fn step(body: &mut MixedBody, (split, pick): &(bool, Index)) {
    let pick = |n: usize| pick.index(n);
    if *split { body.split(pick) } else { body.merge(pick) }
}

/// ‖S(u − u*)‖ / ‖S u*‖, S = |diag K|^½, for a load on all free rows, u* by dense LU of K assembled
/// afresh, refined once.
fn solution_error(body: &MixedBody) -> f64 {
    let k = body.assemble().to_dense();
    let n = k.nrows();
    let scale: Vec<f64> = (0..n).map(|i| k[(i, i)].abs().sqrt()).collect();
    let free = |i: usize| i % 4 == 3 || !body.is_held(body.vertices()[i / 4]);
    let f = DMatrix::from_fn(
        n,
        1,
        |i, _| {
            if free(i) { scale[i] * (1.7 * i as f64).sin() } else { 0.0 }
        },
    );
    let unit = DMatrix::from_fn(n, n, |i, j| k[(i, j)] / scale[i] / scale[j]);
    let load = DMatrix::from_fn(n, 1, |i, _| f[(i, 0)] / scale[i]);
    let lu = unit.clone().lu();
    let mut exact = lu.solve(&load).unwrap();
    exact += lu.solve(&(&load - &unit * &exact)).unwrap();
    let mut u = vec![0.0; n];
    body.maintainer.solve(f.as_slice(), &mut u).unwrap();
    let got = DMatrix::from_fn(n, 1, |i, _| u[i] * scale[i]);
    let error = (&got - &exact).norm() / exact.norm();
    if error.is_nan() { f64::INFINITY } else { error }
}

/// Positive and negative eigenvalues of the maintained K, rows in units of their diagonal, and
/// the smallest one in size.
fn inertia(body: &MixedBody) -> ([usize; 2], f64) {
    let k = body.maintainer.stiffness().to_dense();
    let unit = |i: usize| k[(i, i)].abs().sqrt();
    let scaled = Mat::from_fn(k.nrows(), k.ncols(), |i, j| k[(i, j)] / unit(i) / unit(j));
    let values = scaled.self_adjoint_eigenvalues(Side::Lower).unwrap();
    let positive = values.iter().filter(|&&v| v > 0.0).count();
    let smallest = values.iter().fold(f64::MAX, |least, v| least.min(v.abs()));
    ([positive, values.len() - positive], smallest)
}

/// E ratio 1e3, ν .3, .49 and .4999.
fn contrast(mut organ: Organ) -> Organ {
    organ.materials = vec![(1e3, 0.3), (1e6, 0.49), (3e4, 0.4999)];
    organ
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn every_maintainer_follows_a_short_history(
        organ in organs([1, 1, 1], 3, 2.0..5.0, -0.3..0.4999),
        steps in history(40),
        rule in proptest::sample::select(vec!["laminate", "linear", "paper"]),
    ) {
        for maintainer in yawara_inverse_update::CHOICES {
            let mut body = MixedBody::new(&organ, rule, maintainer, 7);
            steps.iter().for_each(|at| step(&mut body, at));
            let error = solution_error(&body);
            prop_assert!(error < 1e-8, "{}, {}: {:e}", maintainer, rule, error);
        }
    }

    #[test]
    fn one_material_takes_one_change_a_split(
        poisson in 0.3..0.4999f64,
        steps in history(60),
    ) {
        let organ = Organ::homogeneous([2, 1, 1], 1e4, poisson);
        for maintainer in ["woodbury", "sparse"] {
            let mut body = MixedBody::new(&organ, "laminate", maintainer, 7);
            steps.iter().for_each(|at| step(&mut body, at));
            let error = solution_error(&body);
            prop_assert!(error < 1e-11, "{}: {:e}", maintainer, error);
            prop_assert_eq!(body.maintainer.counts().rebuilds, 0);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2,
        max_shrink_iters: 8,
        rng_seed: RngSeed::Fixed(2014),
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_thousand_splits_and_merges_keep_signs_and_solutions(
        organ in organs([2, 1, 1], 3, 3.0..6.0, 0.3..0.49).prop_map(contrast),
        steps in history(1000),
    ) {
        for maintainer in ["sparse", "woodbury"] {
            let mut body = MixedBody::new(&organ, "laminate", maintainer, 8);
            let (mut worst, mut margin) = (0.0, f64::MAX);
            for (count, at) in steps.iter().enumerate() {
                step(&mut body, at);
                if (count + 1) % 100 == 0 {
                    let n = body.vertices().len();
                    let (signs, smallest) = inertia(&body);
                    prop_assert_eq!(signs, [3 * n, n], "after {}", count + 1);
                    let error = solution_error(&body);
                    prop_assert!(error < 1e-9, "{} after {}: {:e}", maintainer, count + 1, error);
                    (worst, margin) = (f64::max(worst, error), f64::min(margin, smallest));
                }
            }
            // The signs above are no accident of rounding.
            prop_assert!(margin > 1e-10, "{:e}", margin);
            let rebuilds = body.maintainer.counts().rebuilds;
            println!("{maintainer}: {} vertices, error {worst:.1e}, smallest eigenvalue \
                      {margin:.1e}, {rebuilds} rebuilds", body.vertices().len());
        }
    }
}
