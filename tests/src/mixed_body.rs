//! A body of mixed elements, clamped at one side, with an inverse that follows its mesh.

use yawara::inverse::{Assembly, SlotMap, hold};
use yawara_embed::{ElementFormulation, Embedding, P1P1};
use yawara_inverse_update::{InverseMaintainer, SparseStiffness, build};
use yawara_mesh::{BisectionForest, Lattice, MeshDelta, Placement, VertexId};

use crate::organ::{Organ, elements};

/// Unknowns per vertex.
const M: usize = 4;

/// Elements `p1p1` on an organ that is clamped where x is least. All vertices have slots: a
/// clamped one keeps its pressure.
pub struct MixedBody {
    /// The mesh.
    pub forest: BisectionForest,
    /// What follows it.
    pub maintainer: Box<dyn InverseMaintainer>,
    placement: Placement,
    embedding: Embedding,
    element: P1P1,
    slots: SlotMap,
    anchor: f64,
    delta: MeshDelta,
}

impl MixedBody {
    /// The organ at level 0, refined down to `max_level` at most, with the maintainer of a name.
    pub fn new(organ: &Organ, homogenisation: &str, maintainer: &str, max_level: u8) -> Self {
        let forest = organ.forest(0, max_level);
        let nothing = SparseStiffness::quasi_definite(0, M, 1).unwrap();
        let mut body = Self {
            slots: SlotMap::new(forest.vertices()),
            placement: organ.placement(max_level),
            embedding: organ.embedding(homogenisation),
            element: P1P1::default(),
            maintainer: build("lu", nothing).unwrap(),
            anchor: organ.materials[0].0 * 0.01,
            delta: MeshDelta::empty(),
            forest,
        };
        body.maintainer = build(maintainer, body.assemble()).unwrap();
        body
    }

    /// Whether the displacements of a vertex are fixed.
    pub fn is_held(&self, vertex: VertexId) -> bool {
        self.forest.point(vertex)[0] == 0
    }

    /// The vertices by slot.
    pub fn vertices(&self) -> &[VertexId] {
        self.slots.vertices()
    }

    /// Splits at one of the candidates, if there is one.
    pub fn split(&mut self, pick: impl Fn(usize) -> usize) {
        let candidates = self.forest.candidates();
        if !candidates.is_empty() {
            let p = candidates[pick(candidates.len())];
            let vertex = self.forest.split(p, &mut self.delta).expect("a candidate");
            self.update(vertex, Lattice::key(p));
        }
    }

    /// Merges one of the vertices that may go, if there is one.
    pub fn merge(&mut self, pick: impl Fn(usize) -> usize) {
        let vertices = self.forest.vertices();
        let ready: Vec<VertexId> = vertices.filter(|&v| self.forest.is_mergeable(v)).collect();
        if !ready.is_empty() {
            let vertex = ready[pick(ready.len())];
            let key = Lattice::key(self.forest.point(vertex));
            self.forest.merge(vertex, &mut self.delta).expect("mergeable");
            self.update(vertex, key);
        }
    }

    /// Gives the maintainer the split or merge that the mesh has just made.
    fn update(&mut self, vertex: VertexId, order_key: u64) {
        let position = |v| self.placement.position(self.forest.point(v));
        let ring = self.element.ring(&self.delta, &self.embedding, &position);
        // The point of a merged vertex is gone, that of the ends of its edge is not.
        let new_is_held = self.delta.edge.iter().all(|&end| self.is_held(end));
        let ring = hold(ring, M, new_is_held, |v| self.is_held(v), self.anchor);
        let update = self.slots.update(self.delta.change, vertex, true, ring, order_key);
        update.expect("every vertex has a slot").make(&mut *self.maintainer).unwrap();
        assert_eq!(self.maintainer.vertices(), self.slots.len());
    }

    /// K in slot order, from all tetrahedra.
    pub fn assemble(&self) -> SparseStiffness {
        let elements = elements(&self.forest, &self.placement, &self.embedding);
        let is_fixed = |v| self.is_held(v);
        let order_key = |v| Lattice::key(self.forest.point(v));
        let assembly = Assembly::new(&self.element, &is_fixed, &order_key);
        let assembly = Assembly { anchor: self.anchor, ..assembly };
        assembly.assemble(elements, &self.slots).expect("finite elements")
    }
}
