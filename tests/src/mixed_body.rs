//! A body of mixed elements, clamped at one side, with an inverse that follows its mesh.

use nalgebra::{DMatrix, Matrix3};
use yawara::inverse::{Assembly, SlotMap, hold};
use yawara_corot::Element;
use yawara_embed::{ElementFormulation, Embedding, LinearTet, P1P1, RingStiffness};
use yawara_inverse_update::{InverseError, InverseMaintainer, SparseStiffness, Update, build};
use yawara_mesh::{BisectionForest, Lattice, MeshDelta, Placement, VertexId};

use crate::organ::Organ;

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
    /// The organ at level 0, refined down to `max_level` at most.
    ///
    /// # Errors
    /// [`InverseError`] if the maintainer does not start.
    pub fn new(
        organ: &Organ,
        homogenisation: &str,
        maintainer: &str,
        max_level: u8,
    ) -> Result<Self, InverseError> {
        let forest = organ.forest(0, max_level);
        let mut body = Self {
            slots: SlotMap::new(forest.vertices()),
            placement: organ.placement(max_level),
            embedding: organ.embedding(homogenisation),
            element: P1P1::default(),
            maintainer: build("lu", SparseStiffness::quasi_definite(0, M, 1)?)?,
            anchor: organ.materials[0].0 * 0.01,
            delta: MeshDelta::empty(),
            forest,
        };
        body.maintainer = build(maintainer, body.stiffness()?)?;
        Ok(body)
    }

    /// Whether the displacements of a vertex are fixed.
    pub fn is_held(&self, vertex: VertexId) -> bool {
        self.forest.point(vertex)[0] == 0
    }

    /// The vertices by slot.
    pub fn vertices(&self) -> &[VertexId] {
        self.slots.vertices()
    }

    /// Splits at one of the candidates. Returns false if there is none.
    ///
    /// # Errors
    /// What the maintainer refuses.
    pub fn split(&mut self, pick: impl Fn(usize) -> usize) -> Result<bool, InverseError> {
        let candidates = self.forest.candidates();
        if candidates.is_empty() {
            return Ok(false);
        }
        let p = candidates[pick(candidates.len())];
        let vertex = self.forest.split(p, &mut self.delta).expect("a candidate");
        self.update(vertex, Lattice::key(p))?;
        Ok(true)
    }

    /// Merges one of the vertices that may go. Returns false if there is none.
    ///
    /// # Errors
    /// What the maintainer refuses.
    pub fn merge(&mut self, pick: impl Fn(usize) -> usize) -> Result<bool, InverseError> {
        let ready: Vec<VertexId> =
            self.forest.vertices().filter(|&v| self.forest.is_mergeable(v)).collect();
        if ready.is_empty() {
            return Ok(false);
        }
        let vertex = ready[pick(ready.len())];
        let key = Lattice::key(self.forest.point(vertex));
        self.forest.merge(vertex, &mut self.delta).expect("mergeable");
        self.update(vertex, key)?;
        Ok(true)
    }

    /// Gives the maintainer the split or merge that the mesh has just made.
    fn update(&mut self, vertex: VertexId, order_key: u64) -> Result<(), InverseError> {
        let ring = self.ring(vertex);
        let slots = self.slots.len();
        match self.slots.update(self.delta.change, vertex, true, ring, order_key) {
            Some(Update::Split(change)) => assert_eq!(self.maintainer.split(&change)?, slots),
            Some(Update::Merge { slot, change }) => _ = self.maintainer.merge(slot, &change)?,
            other => unreachable!("every vertex has a slot: {other:?}"),
        }
        Ok(())
    }

    fn ring(&self, vertex: VertexId) -> RingStiffness {
        let forest = &self.forest;
        let ring = self
            .element
            .ring(&self.delta, &self.embedding, &|v| self.placement.position(forest.point(v)));
        // The point of a merged vertex is gone, that of the ends of its edge is not.
        let new_is_held = self.delta.edge.iter().all(|&end| self.is_held(end));
        debug_assert!(!self.delta.edge.contains(&vertex));
        hold(ring, M, new_is_held, |v| self.is_held(v), self.anchor)
    }

    /// K in slot order, from all tetrahedra.
    pub fn assemble(&self) -> DMatrix<f64> {
        let k = self.stiffness().expect("finite elements").to_dense();
        DMatrix::from_fn(k.nrows(), k.ncols(), |i, j| k[(i, j)])
    }

    fn stiffness(&self) -> Result<SparseStiffness, InverseError> {
        let elements = self.forest.leaves().map(|tet| {
            let corners = tet.vertices.map(|v| self.placement.position(self.forest.point(v)));
            Element {
                tet: tet.id,
                vertices: tet.vertices.map(VertexId::index),
                geometry: LinearTet::new(&corners),
                elasticity: self.embedding.elasticity(tet.node),
                rotation: Matrix3::identity(),
            }
        });
        let is_fixed = |v| self.is_held(v);
        let order_key = |v| Lattice::key(self.forest.point(v));
        let assembly = Assembly::new(&self.element, &is_fixed, &order_key);
        Assembly { anchor: self.anchor, ..assembly }.assemble(elements, &self.slots)
    }
}
