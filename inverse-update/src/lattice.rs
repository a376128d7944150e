//! A lattice that is refined in random places, for tests of maintainers that keep factors.

use faer::Mat;

use crate::accuracy::random;
use crate::change::{Capacitance, RingChange, StiffnessChange, Update};
use crate::maintainer::InverseMaintainer;
use crate::matrix::SparseStiffness;

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
pub(crate) struct Body<M> {
    block: usize,
    negative: usize,
    random: Random,
    pub kept: M,
    /// The name in each slot, and where it lies.
    names: Vec<usize>,
    places: Vec<[u64; 3]>,
    pub refined: Vec<Refined>,
}

/// What was split: the names of its ring, W, the change and the name of the new vertex.
pub(crate) struct Refined {
    ring: Vec<usize>,
    w: Mat<f64>,
    change: RingChange,
    name: usize,
}

fn key(place: [u64; 3]) -> u64 {
    place[0] | place[1] << 21 | place[2] << 42
}

impl<M: InverseMaintainer> Body<M> {
    pub fn new(
        side: u64,
        block: usize,
        negative: usize,
        make: impl FnOnce(SparseStiffness) -> M,
    ) -> Self {
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
        let kept = make(k);
        let names = (0..n).collect();
        Self { block, negative, random, kept, names, places, refined: vec![] }
    }

    fn slots(&self, names: &[usize]) -> Vec<usize> {
        let slot = |name: &usize| self.names.iter().position(|other| other == name).unwrap();
        names.iter().map(slot).collect()
    }

    /// Splits so often, and tells what was done to K.
    pub fn splits(&mut self, count: usize) -> Vec<Update> {
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
    pub fn split(&mut self) {
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
        self.kept.change(&self.exchange(&near, &w, true)).unwrap();
        assert_eq!(self.kept.split(&change), Ok(self.names.len()));
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
    pub fn merge(&mut self) {
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
        assert_eq!(self.kept.merge(slot, &change), Ok((slot != last).then_some(last)));
        self.names.swap_remove(slot);
        self.kept.change(&self.exchange(&ring, &w, false)).unwrap();
    }

    pub fn step(&mut self) {
        if self.random.below(5) < 3 { self.split() } else { self.merge() }
    }
}

/// The sign of entries between two last rows is turned.
fn turned(matrix: &Mat<f64>, block: usize, negative: usize) -> Mat<f64> {
    let last = |i: usize| i % block + negative >= block;
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        if last(i) && last(j) { -matrix[(i, j)] } else { matrix[(i, j)] }
    })
}
