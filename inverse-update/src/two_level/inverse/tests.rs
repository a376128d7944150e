//! Patches against K itself, and when the factor behind them is replaced.

use super::*;
use crate::lattice::Body;
use crate::maintainer::drift;
use crate::sparse::slow_rebases;
use crate::{RingChange, StiffnessChange};

/// A factor that is never replaced.
const FROZEN: TwoLevelOptions =
    TwoLevelOptions { most: 1.0, patience: f64::INFINITY, background: false };

fn lattice(side: u64, block: usize, negative: usize, options: TwoLevelOptions) -> Body<TwoLevel> {
    Body::new(side, block, negative, |k| TwoLevel::with_options(k, options).unwrap())
}

/// ‖D^(−½)(K u − f)‖ / ‖D^(−½) f‖ for a load on all rows, of one cycle.
fn missed(kept: &TwoLevel) -> f64 {
    let k = kept.stiffness();
    let unit = |i: usize| k.diagonal(i).abs().sqrt();
    let f: Vec<f64> = (0..k.dofs()).map(|i| unit(i) * (1.0 + i as f64).sin()).collect();
    let (mut u, mut product) = (vec![0.0; f.len()], vec![0.0; f.len()]);
    kept.precondition(&f, &mut u).unwrap();
    k.apply(&u, &mut product).unwrap();
    let size = |x: &dyn Fn(usize) -> f64| -> f64 {
        (0..f.len()).map(|i| (x(i) / unit(i)).powi(2)).sum::<f64>().sqrt()
    };
    size(&|i| f[i] - product[i]) / size(&|i| f[i])
}

#[test]
fn solutions_hold_with_a_factor_that_is_never_replaced() {
    for (block, negative) in [(1, 0), (3, 0), (2, 1), (4, 1)] {
        let mut body = lattice(6, block, negative, FROZEN);
        for round in 1..=3 {
            (0..5).for_each(|_| body.split());
            let (patch, all) = (body.kept.patch(), body.kept.vertices());
            if negative == 0 {
                assert!(0 < patch && patch < all, "block {block}, round {round}: {patch} of {all}");
                assert!(missed(&body.kept) < 0.3, "block {block}, round {round}");
            }
            let off = drift(&body.kept, round, 8);
            assert!(off < 1e-10, "block {block}, round {round}: {off:e}");
        }
        while !body.refined.is_empty() {
            body.merge();
        }
        assert!(drift(&body.kept, 0, 8) < 1e-10, "block {block}");
        assert_eq!(body.kept.counts().rebuilds, 0);
        assert_eq!(body.kept.adopted(), 0);
    }
}

/// Without changed rows there is nothing to patch, and without a layer it would be no good.
#[test]
fn a_patch_is_what_has_changed_and_a_layer() {
    let mut body = lattice(6, 3, 0, FROZEN);
    assert_eq!(body.kept.patch(), 0);
    assert!(missed(&body.kept) < 1e-2);
    body.split();
    let kept = &body.kept;
    let (patch, layerless) = kept.read(|method| {
        let changed: Vec<usize> =
            (0..kept.vertices()).filter(|&slot| method.since.is_changed[slot]).collect();
        (method.patch.slots.clone(), changed)
    });
    assert!(layerless.len() < patch.len());
    for slot in &layerless {
        kept.stiffness().neighbours(*slot).iter().for_each(|near| assert!(patch.contains(near)));
    }
    let near = missed(kept);
    let patch = Patch::new(kept.stiffness(), layerless).unwrap();
    body.kept.method().patch = patch;
    assert!(missed(&body.kept) > 2.0 * near, "{:e} without, {near:e}", missed(&body.kept));
}

/// What a history comes to, in bits.
fn outcome(options: TwoLevelOptions) -> (Vec<u64>, usize) {
    let mut body = lattice(5, 3, 0, options);
    let mut bits = Vec::new();
    for at in 0..24 {
        body.split();
        let column = body.kept.columns(&[at]).unwrap();
        bits.extend(column.col(1).iter().map(|x| x.to_bits()));
    }
    assert!(drift(&body.kept, 0, 8) < 1e-10);
    assert_eq!(body.kept.counts().rebuilds, 0);
    (bits, body.kept.adopted())
}

#[test]
fn a_factor_is_adopted_after_the_same_work_whoever_makes_it() {
    let options = TwoLevelOptions { most: 1.0, patience: 0.5, background: true };
    let (bits, adopted) = outcome(options);
    assert!(adopted >= 3, "{adopted}");
    assert_eq!(outcome(options).0, bits);
    assert_eq!(outcome(TwoLevelOptions { background: false, ..options }).0, bits);
    slow_rebases(30);
    assert_eq!(outcome(options).0, bits, "a worker that is late");
    slow_rebases(0);
    let never = outcome(TwoLevelOptions { patience: f64::INFINITY, ..options });
    assert_ne!(never.0, bits, "so an adoption can be seen in the bits");
    assert_eq!(never.1, 0);
}

#[test]
fn where_most_rows_change_k_is_factored_at_once() {
    let options = TwoLevelOptions { most: 0.25, ..FROZEN };
    let mut body = lattice(4, 3, 0, options);
    let updates = lattice(4, 3, 0, options).splits(30);
    body.kept.batch(&updates).unwrap();
    assert_eq!((body.kept.patch(), body.kept.vertices()), (0, 94));
    assert!(missed(&body.kept) < 1e-2);
}

/// 30 vertices in a row on springs of 1 N/m, the first one held.
fn row() -> TwoLevel {
    let mut k = SparseStiffness::zeros(30, 1).unwrap();
    k.add(&[0], faer::mat![[1.0]].as_ref()).unwrap();
    let spring = faer::mat![[1.0, -1.0], [-1.0, 1.0]];
    (1..30).for_each(|v| k.add(&[v - 1, v], spring.as_ref()).unwrap());
    TwoLevel::with_options(k, FROZEN).unwrap()
}

#[test]
fn content_that_softens_is_followed_and_a_body_that_comes_loose_refused_by_its_solution() {
    let off = |slot: usize, part: f64| {
        let removed = faer::mat![[part.sqrt()]];
        StiffnessChange { slots: vec![slot], added: Mat::zeros(1, 0), removed }
    };
    let mut softer = row();
    softer.change(&off(0, 0.5)).unwrap();
    assert_eq!(softer.patch(), 2);
    let mut u = [0.0; 30];
    let mut load = [0.0; 30];
    load[29] = 1.0;
    softer.solve(&load, &mut u).unwrap();
    assert!((u[29] - 31.0).abs() < 1e-11, "{}", u[29]);
    let mut loose = row();
    loose.change(&off(0, 1.0)).unwrap();
    let error = loose.solve(&load, &mut u).unwrap_err();
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    // Seen at once where it shows on the patch.
    let mut body = lattice(4, 1, 0, FROZEN);
    let before = body.kept.columns(&[0, 5]).unwrap();
    let own = body.kept.stiffness().diagonal(0);
    let error = body.kept.change(&off(0, own)).unwrap_err();
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    assert_eq!(body.kept.columns(&[0, 5]).unwrap(), before);
}

#[test]
fn a_refused_update_leaves_every_bit() {
    let mut body = lattice(5, 1, 0, FROZEN);
    (0..3).for_each(|_| body.split());
    let before = body.kept.columns(&[1, 60]).unwrap();
    // A ring of springs that push.
    let (a12, a22) = (faer::mat![[-1.0]], faer::mat![[1.0]]);
    let freed = RingChange::freed(vec![7], a12, a22, 0).unwrap();
    let pushes =
        RingChange { k_p: faer::mat![[900.0]], b: faer::mat![[901.0_f64.sqrt()]], ..freed };
    let error = body.kept.split(&pushes).unwrap_err();
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    assert_eq!(body.kept.columns(&[1, 60]).unwrap(), before);
    assert_eq!(body.kept.vertices(), 128);
}
