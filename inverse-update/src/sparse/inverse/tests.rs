//! The factor against K itself, through histories that build up panels, young columns and holes.

use faer::Mat;

use super::*;
use crate::accuracy::random;
use crate::change::Capacitance;
use crate::sparse::factor::{Factor, NONE};
use crate::sparse::rebase;
use crate::{InverseMaintainer, RingChange, StiffnessChange};

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        (random(&mut self.0) % n as u64) as usize
    }

    fn matrix(&mut self, rows: usize, columns: usize) -> Mat<f64> {
        Mat::from_fn(rows, columns, |_, _| self.below(2001) as f64 / 1000.0 - 1.0)
    }
}

/// A cube of vertices, every one held by a spring and tied to its neighbours, that is refined at
/// random. With a negative row per vertex the blocks between these rows are turned in sign.
struct Body {
    block: usize,
    negative: usize,
    random: Random,
    sparse: Sparse,
    /// The name in each slot, and where it lies.
    names: Vec<usize>,
    places: Vec<[u64; 3]>,
    refined: Vec<Refined>,
}

/// What was split: the names of its ring, W, the change and the name of the new vertex.
struct Refined {
    ring: Vec<usize>,
    w: Mat<f64>,
    change: RingChange,
    name: usize,
}

fn key(place: [u64; 3]) -> u64 {
    place[0] | place[1] << 21 | place[2] << 42
}

fn quiet() -> RebaseOptions {
    RebaseOptions { updates: usize::MAX, growth: f64::INFINITY, patience: 0.0, background: false }
}

impl Body {
    fn new(side: u64, block: usize, negative: usize, options: RebaseOptions) -> Self {
        let mut random = Random(side + block as u64);
        let places: Vec<[u64; 3]> = (0..side.pow(3))
            .map(|v| [v % side, v / side % side, v / side / side].map(|x| 1000 * x))
            .collect();
        let n = places.len();
        let mut k = SparseStiffness::quasi_definite(n, block, negative).unwrap();
        k.set_order_keys(&places.iter().map(|&place| key(place)).collect::<Vec<_>>()).unwrap();
        for v in 0..n {
            let near = |w: usize| (0..3).all(|i| places[w][i].abs_diff(places[v][i]) <= 1000);
            let ring: Vec<usize> = (v + 1..n).filter(|&w| near(w)).take(3).chain([v]).collect();
            let factor = random.matrix(block * ring.len(), 2);
            let part = &factor * factor.transpose();
            k.add(&ring, turned(&part, block, negative).as_ref()).unwrap();
            let held = turned(&Mat::identity(block, block), block, negative);
            k.add(&[v], held.as_ref()).unwrap();
        }
        let sparse = Sparse::with_options(k, options).unwrap();
        let names = (0..n).collect();
        Self { block, negative, random, sparse, names, places, refined: vec![] }
    }

    fn slots(&self, names: &[usize]) -> Vec<usize> {
        let slot = |name: &usize| self.names.iter().position(|other| other == name).unwrap();
        names.iter().map(slot).collect()
    }

    /// Splits so often, and tells what was done to K.
    fn splits(&mut self, count: usize) -> Vec<Update> {
        let mut updates = Vec::new();
        for _ in 0..count {
            self.split();
            let Refined { change, w, ring, .. } = &self.refined[self.refined.len() - 1];
            updates.push(Update::Content(self.exchange(ring, w, true)));
            updates.push(Update::Split(change.clone()));
        }
        updates
    }

    /// Refines what is near a random vertex: W Wᵀ comes in, and the elimination of the new vertex
    /// takes θ² W Wᵀ of it.
    fn split(&mut self) {
        let (m, centre) = (self.block, self.random.below(self.names.len()));
        let origin = self.places[self.names[centre]];
        let mut near = self.names.clone();
        near.sort_by_key(|&v| {
            let squares = (0..3).map(|i| self.places[v][i].abs_diff(origin[i]).pow(2));
            (squares.sum::<u64>(), v)
        });
        near.truncate(6);
        let (w, spread) = (self.random.matrix(m * near.len(), m), self.random.matrix(m, m));
        let a22 = &spread * spread.transpose() + Mat::<f64>::identity(m, m);
        let factor = Capacitance::of("a22", a22.as_ref(), 0).unwrap();
        let a12 = &w * factor.lower().transpose() * faer::Scale(0.7);
        let [a12, a22] = [a12, a22].map(|part| turned(&part, m, self.negative));
        let name = self.places.len();
        let place = [0, 1, 2].map(|i| origin[i] + 1 + self.random.below(400) as u64);
        let change = RingChange::freed(self.slots(&near), a12, a22, key(place)).unwrap();
        self.sparse.change(&self.exchange(&near, &w, true)).unwrap();
        assert_eq!(self.sparse.split(&change), Ok(self.names.len()));
        self.names.push(name);
        self.places.push(place);
        self.refined.push(Refined { ring: near, w, change, name });
    }

    /// K ± W Wᵀ on positive rows, ∓ W Wᵀ on negative ones.
    fn exchange(&self, names: &[usize], w: &Mat<f64>, comes: bool) -> StiffnessChange {
        let on = |negative: bool| {
            let columns = if negative && self.negative == 0 { 0 } else { w.ncols() };
            let is_on = |i: usize| (i % self.block + self.negative >= self.block) == negative;
            Mat::from_fn(w.nrows(), columns, |i, j| if is_on(i) { w[(i, j)] } else { 0.0 })
        };
        StiffnessChange { slots: self.slots(names), added: on(!comes), removed: on(comes) }
    }

    /// Undoes a split on which nothing younger stands.
    fn merge(&mut self) {
        let used = |name: &usize| self.refined.iter().any(|part| part.ring.contains(name));
        let free: Vec<usize> =
            (0..self.refined.len()).filter(|&at| !used(&self.refined[at].name)).collect();
        if free.is_empty() {
            return;
        }
        let Refined { ring, w, mut change, name } =
            self.refined.remove(free[self.random.below(free.len())]);
        change.slots = self.slots(&ring);
        let slot = self.slots(&[name])[0];
        let last = self.names.len() - 1;
        assert_eq!(self.sparse.merge(slot, &change), Ok((slot != last).then_some(last)));
        self.names.swap_remove(slot);
        self.sparse.change(&self.exchange(&ring, &w, false)).unwrap();
    }

    fn step(&mut self) {
        if self.random.below(5) < 3 { self.split() } else { self.merge() }
    }

    /// The largest entry of L D Lᵀ − K, relative to √(K_ii K_jj).
    fn error(&self) -> f64 {
        let whole = self.sparse.read(|method| method.based.factor.product());
        let k = self.sparse.stiffness.to_dense();
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

/// The sign of entries between two last rows is turned.
fn turned(matrix: &Mat<f64>, block: usize, negative: usize) -> Mat<f64> {
    let last = |i: usize| i % block + negative >= block;
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        if last(i) && last(j) { -matrix[(i, j)] } else { matrix[(i, j)] }
    })
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
        let mut body = Body::new(4, block, negative, quiet());
        // Rounding of one factorisation; below, of a few hundred operations per entry and update.
        assert!(body.error() < 1e-14, "at the start {:e}", body.error());
        for round in 1..=4 {
            (0..30).for_each(|_| body.step());
            let error = body.error();
            assert!(error < 1e-12, "block {block}, round {round}: {error:e}");
            // From here on, all vertices are in the base: merges have to take columns out of it.
            if round == 2 {
                body.sparse.rebuild().unwrap();
            }
        }
        while !body.refined.is_empty() {
            body.merge();
        }
        assert!(body.error() < 1e-12, "at the end {:e}", body.error());
        assert_eq!(body.sparse.counts().rebuilds, 0);
        let count = |slot: u32| slot != NONE;
        let factor = &body.sparse.method().based.factor;
        let live = factor.slot_of.iter().filter(|&&slot| count(slot)).count();
        assert_eq!(live, factor.vertices());
        let blocks: usize = factor.panels.iter().map(|panel| panel.blocks()).sum();
        assert_eq!(blocks, factor.blocks);
    }
}

#[test]
fn a_long_batch_is_factored_afresh_and_a_short_one_walked() {
    let mut body = Body::new(4, 3, 0, quiet());
    // The same updates twice: made one by one here, in batches there.
    let mut copy = Body::new(4, 3, 0, quiet());
    let updates = body.splits(400);
    let (few, many) = updates.split_at(2);
    copy.sparse.batch(few).unwrap();
    assert_eq!(copy.sparse.rebases(), 0);
    copy.sparse.batch(many).unwrap();
    assert_eq!((copy.sparse.rebases(), copy.sparse.method().journal.len()), (1, 0));
    let (k, want) = (copy.sparse.stiffness.to_dense(), body.sparse.stiffness.to_dense());
    assert!((&k - &want).norm_max() < 1e-13 * want.norm_max());
    assert!(copy.error() < 1e-14, "a fresh factor: {:e}", copy.error());
}

#[test]
fn a_batch_counts_its_small_algebra_and_what_its_own_walks_show() {
    // Walks seem to cost nothing so far.
    let seem_free = |sparse: &mut Sparse| {
        let scratch = &mut sparse.method().scratch;
        (scratch.walks, scratch.operations) = (1_000_000_000, 0.0);
    };
    let mut body = Body::new(4, 3, 0, quiet());
    let mut copy = Body::new(4, 3, 0, quiet());
    seem_free(&mut copy.sparse);
    copy.sparse.batch(&body.splits(400)).unwrap();
    assert_eq!((copy.sparse.rebases(), copy.sparse.method().scratch.walks), (1, 1_000_000_000));
    // Rank one has next to no small algebra: the first walks tell that five thousand are many.
    let added = Mat::from_fn(3, 1, |i, _| if i == 0 { 1e-3 } else { 0.0 });
    let change = StiffnessChange { slots: vec![0], added, removed: Mat::zeros(3, 0) };
    let mut copy = Body::new(4, 3, 0, quiet());
    seem_free(&mut copy.sparse);
    copy.sparse.batch(&vec![Update::Content(change); 5000]).unwrap();
    let walks = copy.sparse.method().scratch.walks - 1_000_000_000;
    assert!(copy.sparse.rebases() == 1 && (1..100).contains(&walks), "{walks} walks");
    assert!(copy.error() < 1e-14, "a fresh factor: {:e}", copy.error());
}

/// Every number of right-hand sides that go together.
#[test]
fn a_column_is_the_same_whatever_it_is_solved_with() {
    let mut body = Body::new(4, 3, 0, quiet());
    (0..60).for_each(|_| body.step());
    let all: Vec<usize> = (0..body.names.len()).collect();
    let whole = body.sparse.columns(&all).unwrap();
    for count in 1..=5 {
        let some = body.sparse.columns(&all[..count]).unwrap();
        assert_eq!(some, whole.submatrix(0, 0, whole.nrows(), 3 * count), "{count} slots");
    }
}

#[test]
fn a_failed_update_leaves_every_bit() {
    let mut body = Body::new(3, 3, 0, quiet());
    (0..25).for_each(|_| body.step());
    let all: Vec<usize> = (0..body.names.len()).collect();
    let before = body.sparse.columns(&all).unwrap();
    // A little less at the vertex that is eliminated first, far too much at the last one: the walk
    // fails at its very end.
    let factor = &body.sparse.method().based.factor;
    let first = (0..body.names.len()).max_by_key(|&slot| factor.position_of[slot]).unwrap();
    let slots = vec![first, factor.slot_of[0] as usize];
    let removed = Mat::from_fn(6, 2, |i, j| if i / 3 == j { [0.05, 100.0][j] } else { 0.0 });
    let change = StiffnessChange { slots, added: Mat::zeros(6, 0), removed };
    let error = body.sparse.change(&change).unwrap_err();
    assert!(matches!(error, InverseError::Singular { .. }), "{error}");
    assert_eq!(body.sparse.columns(&all).unwrap(), before);
    assert!(body.error() < 1e-12);
}

/// What a history comes to, in bits.
fn outcome(options: RebaseOptions) -> (Vec<u64>, usize) {
    let mut body = Body::new(4, 3, 0, options);
    let mut bits = Vec::new();
    for at in 0..70 {
        body.step();
        if at % 5 == 0 {
            let column = body.sparse.columns(&[at]).unwrap();
            bits.extend(column.col(1).iter().map(|x| x.to_bits()));
        }
    }
    assert!(body.error() < 1e-12);
    assert_eq!(body.sparse.counts().rebuilds, 0);
    (bits, body.sparse.rebases())
}

#[test]
fn a_rebase_gives_the_same_bits_wherever_and_whenever_it_is_made() {
    let options = RebaseOptions { updates: 30, growth: 1e9, patience: 0.0, background: true };
    let (bits, rebases) = outcome(options);
    assert!(rebases >= 3, "{rebases}");
    assert_eq!(outcome(options).0, bits);
    assert_eq!(outcome(RebaseOptions { background: false, ..options }).0, bits);
    rebase::SLOW_MS.with(|slow| slow.set(30));
    assert_eq!(outcome(options).0, bits, "a worker that is late");
    rebase::SLOW_MS.with(|slow| slow.set(0));
    let never = RebaseOptions { updates: usize::MAX, ..options };
    assert_ne!(outcome(never).0, bits, "so a re-base can be seen in the bits");
}

/// A stiff part on soft springs has no stiffness of its own to spare for rounding.
#[test]
fn l_is_rounded_where_that_costs_little() {
    for (contrast, may_round) in [(1.0, true), (1e9, true), (1e14, false)] {
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
