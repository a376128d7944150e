//! The factor against K itself, through histories that build up panels, young columns and holes.

use faer::Mat;

use super::*;
use crate::lattice::Body;
use crate::sparse::factor::{Factor, NONE};
use crate::sparse::rebase;
use crate::{InverseMaintainer, StiffnessChange};

fn quiet() -> RebaseOptions {
    RebaseOptions { updates: usize::MAX, growth: f64::INFINITY, patience: 0.0, background: false }
}

type Lattice = Body<Sparse>;

fn lattice(side: u64, block: usize, negative: usize, options: RebaseOptions) -> Lattice {
    Body::new(side, block, negative, |k| Sparse::with_options(k, options).unwrap())
}

impl Lattice {
    /// The largest entry of L D Lᵀ − K, relative to √(K_ii K_jj).
    fn error(&self) -> f64 {
        let whole = self.kept.read(|method| method.based.factor.product());
        let k = self.kept.stiffness.to_dense();
        let mut worst: f64 = 0.0;
        for i in 0..k.nrows() {
            for j in 0..k.nrows() {
                let scale = (k[(i, i)] * k[(j, j)]).abs().sqrt();
                worst = worst.max((whole[(i, j)] - k[(i, j)]).abs() / scale);
            }
        }
        worst
    }
}

impl Factor {
    /// L D Lᵀ in the order of the slots.
    fn product(&self) -> Mat<f64> {
        let (m, n) = (self.block, self.positions());
        let (mut lower, mut d) = (Mat::<f64>::identity(m * n, m * n), Mat::zeros(m * n, m * n));
        for panel in &self.panels {
            let rows: Vec<usize> = panel.positions_from(0).collect();
            for (column, &position) in rows[..panel.width].iter().enumerate() {
                for a in 0..m {
                    let values = &panel.values[panel.stride * (m * column + a)..][..panel.stride];
                    for (at, &row) in rows.iter().enumerate().skip(column + 1) {
                        for b in 0..m {
                            lower[(m * row + b, m * position + a)] = values[m * at + b];
                        }
                    }
                    assert!(values[..m * (column + 1)].iter().all(|&x| x == 0.0));
                    assert!(values[m * rows.len()..].iter().all(|&x| x == 0.0));
                    for b in 0..m {
                        let own = panel.diagonal[m * m * column + m * a + b];
                        d[(m * position + a, m * position + b)] = own;
                    }
                }
            }
        }
        let product = &lower * d * lower.transpose();
        let row = |i: usize| m * self.position_of[i / m] as usize + i % m;
        let vertices = self.vertices();
        Mat::from_fn(m * vertices, m * vertices, |i, j| product[(row(i), row(j))])
    }
}

#[test]
fn l_d_lt_is_k_through_random_histories() {
    for (block, negative) in [(1, 0), (3, 0), (4, 0), (2, 1), (4, 1)] {
        let mut body = lattice(4, block, negative, quiet());
        // Rounding of one factorisation; below, of a few hundred operations per entry and update.
        assert!(body.error() < 1e-14, "at the start {:e}", body.error());
        for round in 1..=4 {
            (0..30).for_each(|_| body.step());
            let error = body.error();
            assert!(error < 1e-12, "block {block}, round {round}: {error:e}");
            // From here on, all vertices are in the base: merges have to take columns out of it.
            if round == 2 {
                body.kept.rebuild().unwrap();
            }
        }
        while !body.refined.is_empty() {
            body.merge();
        }
        assert!(body.error() < 1e-12, "at the end {:e}", body.error());
        assert_eq!(body.kept.counts().rebuilds, 0);
        let count = |slot: u32| slot != NONE;
        let factor = &body.kept.method().based.factor;
        let live = factor.slot_of.iter().filter(|&&slot| count(slot)).count();
        assert_eq!(live, factor.vertices());
        let blocks: usize = factor.panels.iter().map(|panel| panel.blocks()).sum();
        assert_eq!(blocks, factor.blocks);
    }
}

#[test]
fn a_long_batch_is_factored_afresh_and_a_short_one_walked() {
    let mut body = lattice(4, 3, 0, quiet());
    // The same updates twice: made one by one here, in batches there.
    let mut copy = lattice(4, 3, 0, quiet());
    let updates = body.splits(400);
    let (few, many) = updates.split_at(2);
    copy.kept.batch(few).unwrap();
    assert_eq!(copy.kept.rebases(), 0);
    copy.kept.batch(many).unwrap();
    assert_eq!((copy.kept.rebases(), copy.kept.method().journal.len()), (1, 0));
    let (k, want) = (copy.kept.stiffness.to_dense(), body.kept.stiffness.to_dense());
    assert!((&k - &want).norm_max() < 1e-13 * want.norm_max());
    assert!(copy.error() < 1e-14, "a fresh factor: {:e}", copy.error());
}

#[test]
fn a_due_factor_that_costs_few_updates_is_made_by_the_next_batch() {
    let options =
        RebaseOptions { updates: 4, growth: f64::INFINITY, patience: 0.0, background: false };
    // A factor takes as long as so many updates.
    let with = |cost: f64| {
        let mut body = lattice(4, 3, 0, options);
        let fresh = body.kept.read(|method| method.costs(&body.kept.stiffness, (0, 0.0)).1);
        let scratch = &mut body.kept.method().scratch;
        (scratch.walks, scratch.operations) = (1_000_000_000, 1e9 * fresh / cost);
        body
    };
    let updates = lattice(4, 3, 0, quiet()).splits(3);
    let seen = |body: &mut Lattice| {
        let method = body.kept.method();
        (method.rebases, method.journal.len(), method.rebase.is_some())
    };
    for (cost, due, after) in
        [(4.0, (0, 4, false), (1, 0, false)), (16.0, (0, 4, true), (0, 6, true))]
    {
        let mut body = with(cost);
        updates[..4].chunks(2).for_each(|some| body.kept.batch(some).unwrap());
        assert_eq!(seen(&mut body), due, "{cost} updates a factor");
        body.kept.batch(&updates[4..]).unwrap();
        assert_eq!(seen(&mut body), after, "{cost} updates a factor");
        assert!(body.error() < 1e-13, "{:e}", body.error());
    }
    // Whoever makes one after the other has no next batch.
    let mut body = with(4.0);
    updates[..4].iter().for_each(|update| update.make(&mut body.kept).unwrap());
    assert_eq!(seen(&mut body), (0, 4, true));
}

#[test]
fn a_batch_counts_its_small_algebra_and_what_its_own_walks_show() {
    // Walks seem to cost nothing so far.
    let seem_free = |sparse: &mut Sparse| {
        let scratch = &mut sparse.method().scratch;
        (scratch.walks, scratch.operations) = (1_000_000_000, 0.0);
    };
    let mut body = lattice(4, 3, 0, quiet());
    let mut copy = lattice(4, 3, 0, quiet());
    seem_free(&mut copy.kept);
    copy.kept.batch(&body.splits(400)).unwrap();
    assert_eq!((copy.kept.rebases(), copy.kept.method().scratch.walks), (1, 1_000_000_000));
    // Rank one has next to no small algebra: the first walks tell that four hundred are many.
    let added = Mat::from_fn(3, 1, |i, _| if i == 0 { 1e-3 } else { 0.0 });
    let change = StiffnessChange { slots: vec![0], added, removed: Mat::zeros(3, 0) };
    let mut copy = lattice(4, 3, 0, quiet());
    seem_free(&mut copy.kept);
    copy.kept.batch(&vec![Update::Content(change); 400]).unwrap();
    let walks = copy.kept.method().scratch.walks - 1_000_000_000;
    assert!(copy.kept.rebases() == 1 && (1..100).contains(&walks), "{walks} walks");
    assert!(copy.error() < 1e-14, "a fresh factor: {:e}", copy.error());
}

/// Every number of right-hand sides that go together.
#[test]
fn a_column_is_the_same_whatever_it_is_solved_with() {
    let mut body = lattice(4, 3, 0, quiet());
    (0..60).for_each(|_| body.step());
    let all: Vec<usize> = (0..body.kept.vertices()).collect();
    let whole = body.kept.columns(&all).unwrap();
    for count in 1..=5 {
        let some = body.kept.columns(&all[..count]).unwrap();
        assert_eq!(some, whole.submatrix(0, 0, whole.nrows(), 3 * count), "{count} slots");
    }
}

#[test]
fn a_failed_update_leaves_every_bit() {
    let mut body = lattice(3, 3, 0, quiet());
    (0..25).for_each(|_| body.step());
    let all: Vec<usize> = (0..body.kept.vertices()).collect();
    let before = body.kept.columns(&all).unwrap();
    // A little less at the vertex that is eliminated first, far too much at the last one: the walk
    // fails at its very end.
    let vertices = body.kept.vertices();
    let factor = &body.kept.method().based.factor;
    let first = (0..vertices).max_by_key(|&slot| factor.position_of[slot]).unwrap();
    let slots = vec![first, factor.slot_of[0] as usize];
    let removed = Mat::from_fn(6, 2, |i, j| if i / 3 == j { [0.05, 100.0][j] } else { 0.0 });
    let change = StiffnessChange { slots, added: Mat::zeros(6, 0), removed };
    let error = body.kept.change(&change).unwrap_err();
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    assert_eq!(body.kept.columns(&all).unwrap(), before);
    assert!(body.error() < 1e-12);
}

/// What a history comes to, in bits.
fn outcome(options: RebaseOptions) -> (Vec<u64>, usize) {
    let mut body = lattice(4, 3, 0, options);
    let mut bits = Vec::new();
    for at in 0..70 {
        body.step();
        if at % 5 == 0 {
            let column = body.kept.columns(&[at]).unwrap();
            bits.extend(column.col(1).iter().map(|x| x.to_bits()));
        }
    }
    assert!(body.error() < 1e-12);
    assert_eq!(body.kept.counts().rebuilds, 0);
    (bits, body.kept.rebases())
}

#[test]
fn a_rebase_gives_the_same_bits_wherever_and_whenever_it_is_made() {
    let options = RebaseOptions { updates: 30, growth: 1e9, patience: 0.0, background: true };
    let (bits, rebases) = outcome(options);
    assert!(rebases >= 3, "{rebases}");
    assert_eq!(outcome(options).0, bits);
    assert_eq!(outcome(RebaseOptions { background: false, ..options }).0, bits);
    rebase::slow_rebases(30);
    assert_eq!(outcome(options).0, bits, "a worker that is late");
    rebase::slow_rebases(0);
    let never = RebaseOptions { updates: usize::MAX, ..options };
    assert_ne!(outcome(never).0, bits, "so a re-base can be seen in the bits");
}

/// A stiff part on soft springs has no stiffness of its own to spare for rounding.
#[test]
fn l_is_rounded_where_that_costs_little() {
    for (contrast, may_round) in [(1.0, true), (1e9, true), (3e14, false)] {
        let n = 40;
        let mut k = SparseStiffness::zeros(n, 1).unwrap();
        for i in 0..n {
            k.add(&[i], faer::mat![[1.0]].as_ref()).unwrap();
        }
        for i in 1..n {
            let h = if i < n / 2 { contrast } else { 1.0 };
            for j in 0..i {
                // What leaves the stiff part as it is has no simple numbers.
                let [a, b] = [i, j].map(|i| 1.0 / (1.0 + 0.3 * (i as f64).sin()));
                let spring = faer::mat![[h * a * a, -h * a * b], [-h * a * b, h * b * b]];
                k.add(&[i, j], spring.as_ref()).unwrap();
            }
        }
        let sparse = Sparse::new(k).unwrap();
        assert_eq!(sparse.read(|method| method.based.factor.may_round), may_round, "{contrast:e}");
        let f: Vec<f64> = (0..n).map(|i| 1.0 + (i % 3) as f64).collect();
        let (mut whole, mut applied) = (vec![0.0; n], vec![0.0; n]);
        sparse.solve(&f, &mut whole).unwrap();
        sparse.precondition(&f, &mut applied).unwrap();
        let missed = whole.iter().zip(&applied).map(|(a, b)| (a - b).abs() / a.abs());
        let missed = missed.fold(0.0, f64::max);
        assert_eq!(missed > 1e-12, may_round, "{contrast:e}: {missed:e}");
        assert!(missed < 1e-2, "{contrast:e}: {missed:e}");
    }
}
