//! An organ whose mesh changes, clamped at one side, with an inverse that follows.

use faer::Mat;
use proptest::sample::Index;
use yawara::{Elements, InverseFactory, InverseLink};
use yawara_corot::Body;
use yawara_embed::{Embedding, formulation_by_name};
use yawara_mesh::kuhn::Point;
use yawara_mesh::{BisectionForest, Lattice, MeshDelta, Placement, Tet, VertexId};

use crate::organ::{Organ, element, elements};

const MAX_LEVEL: u8 = 8;

/// An organ clamped in a slab of a third of a base cell at its low x side, with an inverse that
/// follows its mesh.
pub struct ClampedBody {
    /// The mesh.
    pub forest: BisectionForest,
    /// Its elements.
    pub body: Body,
    /// Their inverse.
    pub link: InverseLink,
    placement: Placement,
    embedding: Embedding,
    fixed: Vec<bool>,
    delta: MeshDelta,
}

impl ClampedBody {
    /// At level 0, of the element and with the maintainer of these names.
    pub fn new(
        organ: &Organ,
        homogenisation: &str,
        maintainer: &'static str,
        element: &str,
    ) -> Self {
        let forest = organ.forest(0, MAX_LEVEL);
        let placement = organ.placement(MAX_LEVEL);
        let embedding = organ.embedding(homogenisation);
        let mut fixed = vec![false; forest.vertex_capacity()];
        for v in forest.vertices() {
            fixed[v.index()] = is_in_slab(&forest, forest.point(v));
        }
        let mut body = Body::new();
        elements(&forest, &placement, &embedding).for_each(|element| body.insert(element));
        let factory: InverseFactory = Box::new(|k| yawara_inverse_update::build(maintainer, k));
        let key = |v| Lattice::key(forest.point(v));
        let formulation = formulation_by_name(element).unwrap();
        let (is_fixed, vertices) = (|v: usize| fixed[v], forest.vertices());
        let link =
            InverseLink::new(&of(&body), formulation, vertices, is_fixed, key, factory).unwrap();
        Self { forest, body, link, placement, embedding, fixed, delta: MeshDelta::empty() }
    }

    /// Splits if `split`, or else merges, what `pick` picks of what can be, and has the inverse follow.
    pub fn step(&mut self, (split, pick): &(bool, Index)) {
        self.change(*split, pick);
        self.link.flush(&of(&self.body)).unwrap();
    }

    /// Several of these in one batch; then the inverse watches itself.
    pub fn batch(&mut self, steps: &[(bool, Index)]) {
        steps.iter().for_each(|(split, pick)| self.change(*split, pick));
        self.link.flush(&of(&self.body)).unwrap();
        self.link.watch(steps.len() as u64, &of(&self.body)).unwrap();
    }

    fn change(&mut self, split: bool, pick: &Index) {
        let v = if split {
            let candidates = self.forest.candidates();
            if candidates.is_empty() {
                return;
            }
            let p = candidates[pick.index(candidates.len())];
            let v = self.forest.split(p, &mut self.delta).unwrap();
            self.fixed.resize(self.fixed.len().max(v.index() + 1), false);
            // Mostly with one end outside of the slab.
            self.fixed[v.index()] = is_in_slab(&self.forest, p);
            v
        } else {
            let ready: Vec<VertexId> =
                self.forest.vertices().filter(|&v| self.forest.is_mergeable(v)).collect();
            if ready.is_empty() {
                return;
            }
            let v = ready[pick.index(ready.len())];
            self.forest.merge(v, &mut self.delta).unwrap();
            v
        };
        for ring_tet in &self.delta.ring {
            let (gone, come): (&[Tet], &[Tet]) = match split {
                true => (std::slice::from_ref(&ring_tet.parent), &ring_tet.children),
                false => (&ring_tet.children, std::slice::from_ref(&ring_tet.parent)),
            };
            gone.iter().for_each(|tet| _ = self.body.remove(tet.id));
            for tet in come {
                let made = element(&self.forest, &self.placement, &self.embedding, tet);
                self.body.insert(made);
            }
        }
        let position = |v: VertexId| self.placement.position(self.forest.point(v));
        let ring = self.link.element().ring(&self.delta, &self.embedding, &position);
        let key = Lattice::key(self.forest.point(v));
        self.link.push(self.delta.change, v, self.fixed[v.index()], key, ring);
    }

    /// Whether the displacements of a vertex are fixed.
    pub fn is_fixed(&self, vertex: usize) -> bool {
        self.fixed[vertex]
    }

    /// K in slots, added up element by element; rows of fixed displacements are zero.
    pub fn stiffness(&self) -> Mat<f64> {
        let m = self.link.element().unknowns();
        let n = m * self.link.maintainer().vertices();
        let mut k = Mat::<f64>::zeros(n, n);
        for e in self.body.elements() {
            let ke = self.link.element().stiffness(&e.geometry, &e.elasticity);
            let is_fixed = |i: usize| i % m < 3 && self.fixed[e.vertices[i / m]];
            let slot = |i: usize| self.link.slot(e.vertices[i / m]).filter(|_| !is_fixed(i));
            let row = |i: usize| slot(i).map(|s| m * s + i % m);
            for (i, j) in (0..4 * m).flat_map(|i| (0..4 * m).map(move |j| (i, j))) {
                if let (Some(r), Some(c)) = (row(i), row(j)) {
                    k[(r, c)] += ke[(i, j)];
                }
            }
        }
        k
    }
}

fn of(body: &Body) -> Elements<'_> {
    Elements { body, density: &|_| 0.0 }
}

fn is_in_slab(forest: &BisectionForest, p: Point) -> bool {
    3 * p[0] <= forest.domain().lattice().units
}
