//! A body of mixed elements, clamped at one side, with an inverse that follows its mesh.

use faer::Mat;
use nalgebra::DMatrix;
use yawara_embed::{ElementFormulation, Embedding, LinearTet, P1P1, RingStiffness, clamp};
use yawara_inverse_update::{InverseError, InverseMaintainer, RingChange, SparseStiffness, build};
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
    vertex_of: Vec<VertexId>,
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
            vertex_of: forest.vertices().collect(),
            placement: organ.placement(max_level),
            embedding: organ.embedding(homogenisation),
            element: P1P1::default(),
            maintainer: build("lu", SparseStiffness::quasi_definite(0, M, 1)?)?,
            anchor: organ.materials[0].0 * 0.01,
            delta: MeshDelta::empty(),
            forest,
        };
        let dense = body.assemble();
        let mut k = SparseStiffness::quasi_definite(body.vertex_of.len(), M, 1)?;
        let keys: Vec<u64> =
            body.vertex_of.iter().map(|&v| Lattice::key(body.forest.point(v))).collect();
        k.set_order_keys(&keys)?;
        let all: Vec<usize> = (0..body.vertex_of.len()).collect();
        let dense = Mat::from_fn(dense.nrows(), dense.ncols(), |i, j| dense[(i, j)]);
        k.add(&all, dense.as_ref())?;
        body.maintainer = build(maintainer, k)?;
        Ok(body)
    }

    /// Whether the displacements of a vertex are fixed.
    pub fn is_held(&self, vertex: VertexId) -> bool {
        self.forest.point(vertex)[0] == 0
    }

    /// The vertices by slot.
    pub fn vertices(&self) -> &[VertexId] {
        &self.vertex_of
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
        let ring = self.ring(vertex);
        let key = Lattice::key(p);
        let slot = self.maintainer.split(&self.change(ring, key))?;
        assert_eq!(slot, self.vertex_of.len());
        self.vertex_of.push(vertex);
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
        let ring = self.ring(vertex);
        let slot = self.slot(vertex);
        self.maintainer.merge(slot, &self.change(ring, key))?;
        self.vertex_of.swap_remove(slot);
        Ok(true)
    }

    fn slot(&self, vertex: VertexId) -> usize {
        self.vertex_of.iter().position(|&v| v == vertex).expect("a vertex of the mesh")
    }

    fn ring(&self, vertex: VertexId) -> RingStiffness {
        let forest = &self.forest;
        let ring = self
            .element
            .ring(&self.delta, &self.embedding, &|v| self.placement.position(forest.point(v)));
        // The point of a merged vertex is gone, that of the ends of its edge is not.
        let new_is_held = self.delta.edge.iter().all(|&end| self.is_held(end));
        debug_assert!(!self.delta.edge.contains(&vertex));
        ring.clamp(|v| self.is_held(v), new_is_held, self.anchor)
    }

    fn change(&self, ring: RingStiffness, order_key: u64) -> RingChange {
        let RingStiffness { vertices, k_p, k_c, a12, a22, b, positive, negative } = ring;
        let slots = vertices.into_iter().map(|v| self.slot(v)).collect();
        RingChange { slots, k_p, k_c, a12, a22, b, positive, negative, order_key }
    }

    /// K in slot order, from all tetrahedra.
    pub fn assemble(&self) -> DMatrix<f64> {
        let n = M * self.vertex_of.len();
        let mut k = DMatrix::zeros(n, n);
        for tet in self.forest.leaves() {
            let corners = tet.vertices.map(|v| self.placement.position(self.forest.point(v)));
            let elasticity = self.embedding.elasticity(tet.node);
            let mut part = self.element.stiffness(&LinearTet::new(&corners), &elasticity);
            clamp(&mut part, &tet.vertices.map(|v| self.is_held(v)));
            let slots = tet.vertices.map(|v| self.slot(v));
            let row = |i: usize| M * slots[i / M] + i % M;
            for (i, j) in (0..4 * M).flat_map(|i| (0..4 * M).map(move |j| (i, j))) {
                k[(row(i), row(j))] += part[(i, j)];
            }
        }
        for (slot, _) in self.vertex_of.iter().enumerate().filter(|(_, v)| self.is_held(**v)) {
            (0..3).for_each(|axis| k[(M * slot + axis, M * slot + axis)] += self.anchor);
        }
        k
    }
}
