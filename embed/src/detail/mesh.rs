//! A fine mesh whose vertices follow from those of a coarse one.

use std::sync::Arc;

use nalgebra::{Matrix3, SMatrix, Vector3};
use yawara_mesh::{BisectionForest, Tet, VertexId};

use crate::embedding::Embedding;
use crate::error::EmbedError;
use crate::fine::lattice_tet;
use crate::linear_tet::{LinearTet, strain_from_gradient};

/// The rotation R of a deformation gradient F; the identity where displacements are small and
/// everything is to stay linear.
pub type RotationOf<'a> = &'a dyn Fn(&Matrix3<f64>) -> Matrix3<f64>;

/// A forest, as fine as surfaces want it, whose vertices get their positions from the active
/// mesh of a simulation on the same root cubes.
///
/// Every vertex has one position, whatever tetrahedra it belongs to, so surfaces bound to its
/// edges stay closed: a vertex that is active in the simulation is where the simulation has it;
/// any other one lies, in generation order, at
///
/// x_M = ½(x_a + x_b) + Σ V R X ε / Σ V,
///
/// summed over the tetrahedra around the edge (a, b) that it bisects, with X of the
/// homogenisation, R their rotation and ε = sym(RᵀF) − I: a stiff grain in a soft coarse
/// tetrahedron hardly strains, what is around it strains the more. X = 0 where all is of one
/// material. A point bound to an edge (a cut of an iso-surface) moves with the edge's ends.
pub struct DetailMesh {
    forest: BisectionForest,
    /// Ascending generations; what a position depends on comes before it.
    steps: Vec<Step>,
    parents: Vec<EmbeddedParent>,
    /// Length of a lattice unit, m.
    unit: f64,
}

/// How a vertex follows from older ones.
pub(crate) struct Step {
    pub vertex: VertexId,
    /// The ends of the edge that it bisects; none for a corner of a root cube.
    pub ends: Option<[VertexId; 2]>,
    /// Its heterogeneous parents among all.
    first: u32,
    count: u8,
    /// 1 over the number of all its parents, which have the same volume.
    weight: f64,
}

/// A heterogeneous tetrahedron around a bisected edge.
struct EmbeddedParent {
    corners: [VertexId; 4],
    /// X, m.
    midpoint: SMatrix<f64, 3, 6>,
}

impl DetailMesh {
    /// Orders the vertices of `forest`; without a material, all middles stay in the middle
    /// (X = 0). Cost: O(n log n).
    pub fn new(forest: BisectionForest) -> Self {
        let lattice = *forest.domain().lattice();
        let step = |vertex: VertexId| {
            let ends = lattice
                .edge_ends(forest.point(vertex))
                .and_then(|[a, b]| Some([forest.vertex_at(a)?, forest.vertex_at(b)?]));
            Step { vertex, ends, first: 0, count: 0, weight: 0.0 }
        };
        let mut steps: Vec<_> = forest.vertices().map(step).collect();
        steps.sort_by_key(|step| forest.generation(step.vertex));
        Self { forest, steps, parents: Vec::new(), unit: 1.0 }
    }

    /// As [`new`](Self::new), with X of `embedding`; `unit` is the length of the forest's lattice
    /// unit (m).
    ///
    /// Cost: one combination of halves per heterogeneous tetrahedron that the forest bisects;
    /// 160 bytes each.
    /// # Errors
    /// [`EmbedError::OtherTree`] if the embedding is of other labels; [`EmbedError::Range`].
    pub fn embedded(
        forest: BisectionForest,
        embedding: &Embedding,
        unit: f64,
    ) -> Result<Self, EmbedError> {
        let (tree, other) = (forest.tree(), embedding.tree());
        let alike = tree.grid() == other.grid() && tree.node_count() == other.node_count();
        if !(Arc::ptr_eq(tree, other) || alike) {
            let (found, want) = (other.node_count(), tree.node_count());
            return Err(EmbedError::OtherTree { found, want });
        }
        if !(unit > 0.0 && unit.is_finite()) {
            let (what, want) = ("the lattice unit, m,", "a finite length > 0");
            return Err(EmbedError::Range { what, value: unit, want });
        }
        let mut mesh = Self { unit, ..Self::new(forest) };
        let mut ring = Vec::new();
        for step in &mut mesh.steps {
            mesh.forest.ring_of(step.vertex, &mut ring);
            step.first = mesh.parents.len() as u32;
            let found = ring.iter().filter_map(|tet| parent(&mesh.forest, embedding, tet, unit));
            mesh.parents.extend(found);
            step.count = (mesh.parents.len() - step.first as usize) as u8;
            step.weight = 1.0 / ring.len().max(1) as f64;
        }
        Ok(mesh)
    }

    /// The forest, for surfaces and fields on it.
    pub fn forest(&self) -> &BisectionForest {
        &self.forest
    }

    pub(crate) fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Calls `visit` with every older vertex that the position of `step` depends on.
    pub(crate) fn each_input(&self, step: &Step, mut visit: impl FnMut(VertexId)) {
        step.ends.into_iter().flatten().for_each(&mut visit);
        for parent in self.parents_of(step) {
            parent.corners.into_iter().for_each(&mut visit);
        }
    }

    /// Where the vertex of `step` lies, from the positions of its inputs. A corner of a root cube
    /// that the active mesh leaves out does not move, nor is it drawn: NaN.
    pub(crate) fn place(
        &self,
        step: &Step,
        x: &[Vector3<f64>],
        rotation: RotationOf<'_>,
    ) -> Vector3<f64> {
        let Some([a, b]) = step.ends else { return Vector3::repeat(f64::NAN) };
        let middle = 0.5 * (x[a.index()] + x[b.index()]);
        let mut offset = Vector3::zeros();
        for parent in self.parents_of(step) {
            let geometry = lattice_geometry(&self.forest, &parent.corners);
            let f = geometry.gradient(&parent.corners.map(|v| x[v.index()])) / self.unit;
            let r = rotation(&f);
            let strain = strain_from_gradient(&(r.transpose() * f - Matrix3::identity()));
            offset += r * (parent.midpoint * strain);
        }
        // No sum, no rounding: a middle stays one to the last bit.
        if step.count == 0 { middle } else { middle + step.weight * offset }
    }

    fn parents_of(&self, step: &Step) -> &[EmbeddedParent] {
        &self.parents[step.first as usize..step.first as usize + usize::from(step.count)]
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.forest.bytes()
            + self.steps.capacity() * size_of::<Step>()
            + self.parents.capacity() * size_of::<EmbeddedParent>()
    }
}

fn lattice_geometry(forest: &BisectionForest, corners: &[VertexId; 4]) -> LinearTet {
    lattice_tet(&corners.map(|v| forest.point(v)))
}

/// A tetrahedron around a bisected edge, if its vertex strays from the middle.
fn parent(
    forest: &BisectionForest,
    embedding: &Embedding,
    tet: &Tet,
    unit: f64,
) -> Option<EmbeddedParent> {
    let geometry = lattice_geometry(forest, &tet.vertices);
    let midpoint = embedding.combine(tet.node, &geometry, tet.level).1.midpoint;
    let strays = midpoint.iter().any(|&x| x != 0.0);
    strays.then(|| EmbeddedParent { corners: tet.vertices, midpoint: midpoint * unit })
}
