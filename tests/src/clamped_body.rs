//! An organ whose mesh changes, clamped at one side, with an inverse that follows.

use std::collections::BTreeSet;

use faer::Mat;
use proptest::sample::Index;
use yawara::{Elements, InverseFactory, InverseLink};
use yawara_corot::Body;
use yawara_embed::{Embedding, formulation_by_name};
use yawara_mesh::kuhn::Point;
use yawara_mesh::{
    BisectionForest, Change, Doubled, Lattice, MeshDelta, Placement, Severed, Tet, TetId, VertexId,
};

use crate::cuts::{Cut, by_plane, parted};
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

    /// Severs what a plane parts, if `severs`, or else closes what it parts among what is severed, unless that leaves
    /// a piece that nothing holds; the inverse follows. Returns whether it was done.
    pub fn cut(&mut self, severs: bool, (normal, offset, ball): Cut) -> bool {
        self.cut_faces(severs, &parted(&self.forest, by_plane(normal, offset, ball)))
    }

    /// The same of given faces.
    pub fn cut_faces(&mut self, severs: bool, faces: &[Severed]) -> bool {
        let apply = |forest: &mut BisectionForest| match severs {
            true => forest.sever(faces).unwrap(),
            false => {
                forest.close(&faces.iter().map(|severed| severed.face).collect::<Vec<_>>()).unwrap()
            }
        };
        let mut trial = self.forest.clone();
        apply(&mut trial);
        if !self.is_held(&trial) {
            return false;
        }
        let delta = apply(&mut self.forest);
        self.embedding.adopt(self.forest.tree().clone(), &delta.parts).unwrap();
        for Doubled { vertex, twin, .. } in &delta.doubled {
            self.fixed.resize(self.fixed.len().max(vertex.index() + 1), false);
            if delta.change == Change::Split {
                self.fixed[vertex.index()] = self.fixed[twin.index()];
            }
        }
        let (forest, placement, embedding) = (&self.forest, &self.placement, &self.embedding);
        let made_of = |tet: &Tet| {
            let made = element(forest, placement, embedding, tet);
            (made.geometry, made.elasticity, 0.0)
        };
        let (fixed, key) = (&self.fixed, |v| Lattice::key(forest.point(v)));
        self.link.cut(&delta, &made_of, &|_| None, &|v| fixed[v.index()], &key).unwrap();
        let touched = delta.recast.iter().flat_map(|recast| &recast.before);
        let touched = touched.chain(delta.doubled.iter().flat_map(|doubled| &doubled.tets));
        let touched: BTreeSet<TetId> = touched.map(|tet| tet.id).collect();
        touched.iter().for_each(|&tet| _ = self.body.remove(tet));
        let leaves = self.forest.leaves();
        let come: Vec<Tet> = leaves.filter(|tet| self.body.number(tet.id).is_none()).collect();
        for tet in come {
            self.body.insert(element(&self.forest, &self.placement, &self.embedding, &tet));
        }
        self.link.flush(&of(&self.body)).unwrap();
        true
    }

    /// Whether the slab holds each piece of a mesh in three points that are not in line.
    fn is_held(&self, forest: &BisectionForest) -> bool {
        let mut piece: Vec<usize> = (0..forest.vertex_capacity()).collect();
        let leaves: Vec<[usize; 4]> =
            forest.leaves().map(|tet| tet.vertices.map(VertexId::index)).collect();
        let mut grows = true;
        while std::mem::take(&mut grows) {
            for corners in &leaves {
                let least = corners.map(|v| piece[v]).into_iter().min().unwrap_or(0);
                grows |= corners.iter().any(|&v| piece[v] != least);
                corners.iter().for_each(|&v| piece[v] = least);
            }
        }
        forest.vertices().all(|first| {
            let own = forest.vertices().filter(|v| piece[v.index()] == piece[first.index()]);
            let held = own.map(|v| forest.point(v)).filter(|&p| is_in_slab(forest, p));
            let held: Vec<Point> = held.collect();
            held.iter().any(|b| {
                held.iter().any(|c| {
                    let [u, v] = [b, c].map(|p| [0, 1, 2].map(|i| p[i] - held[0][i]));
                    (0..3).any(|i| u[i] * v[(i + 1) % 3] != u[(i + 1) % 3] * v[i])
                })
            })
        })
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
