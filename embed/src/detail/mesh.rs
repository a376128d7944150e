//! A fine mesh whose vertices follow from those of a coarse one.

use std::sync::Arc;

use nalgebra::{Matrix3, SMatrix, Vector3};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{BisectionForest, Tet, VertexId};

use crate::embedding::{Embedding, MeanElasticities};
use crate::error::EmbedError;
use crate::fine::lattice_tet;
use crate::homogenisation::ChildPair;
use crate::linear_tet::{LinearTet, strain_from_gradient};

/// The rotation R of a deformation gradient F; the identity where displacements are small and
/// everything is to stay linear.
pub type RotationOf<'a> = &'a dyn Fn(&Matrix3<f64>) -> Matrix3<f64>;

/// What a half keeps at least of its volume when the vertex between the halves leaves the middle.
/// Strains beyond are none that small ones tell of.
const LEAST_HALF: f64 = 0.5;

/// A forest, as fine as surfaces want it, whose vertices get their positions from the active
/// mesh of a simulation on the same root cubes.
///
/// Every vertex has one position, whatever tetrahedra it belongs to, so surfaces bound to its
/// edges stay closed: a vertex that is active in the simulation is where the simulation has it;
/// any other one lies, in generation order, at
///
/// x_M = ½(x_a + x_b) − (Σ A)⁻¹ Σ R Cᵀε,
///
/// summed over the tetrahedra around the edge (a, b) that it bisects: strains of their halves differ
/// from their means ε = sym(RᵀF) − I by ±N d with the one d for which the energy of all halves is
/// least. R is a tetrahedron's rotation (the same in all of them for the least), A = Nᵀ(D₁+D₂)N,
/// C = (D₁−D₂)N with the *mean* elasticity of the halves whatever the homogenisation,
/// N = ½(G₁−G₂): a stiff grain in a soft coarse tetrahedron hardly strains, what is around it strains
/// the more.
/// Void pulls at nothing: C = 0 where a tetrahedron holds some. No tetrahedron turns over unless an
/// active one has: an offset that would leave a half less than half its volume is shortened.
///
/// A point bound to an edge (a cut of an iso-surface) moves with the edge's ends.
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
    /// Its parents among all; none where it stays in the middle.
    first: u32,
    count: u8,
}

/// A tetrahedron around a bisected edge whose vertex leaves the middle.
struct EmbeddedParent {
    corners: [VertexId; 4],
    /// −(Σ A)⁻¹Cᵀ, m.
    midpoint: SMatrix<f64, 3, 6>,
}

impl EmbeddedParent {
    fn pulls(&self) -> bool {
        self.midpoint.iter().any(|&x| x != 0.0)
    }
}

impl DetailMesh {
    /// Orders the vertices of `forest`; without a material, all middles stay in the middle.
    /// Cost: O(n log n).
    pub fn new(forest: BisectionForest) -> Self {
        let lattice = *forest.domain().lattice();
        let step = |vertex: VertexId| {
            let ends = lattice
                .edge_ends(forest.point(vertex))
                .and_then(|[a, b]| Some([forest.vertex_at(a)?, forest.vertex_at(b)?]));
            Step { vertex, ends, first: 0, count: 0 }
        };
        let mut steps: Vec<_> = forest.vertices().map(step).collect();
        steps.sort_by_key(|step| forest.generation(step.vertex));
        Self { forest, steps, parents: Vec::new(), unit: 1.0 }
    }

    /// As [`new`](Self::new), with vertices displaced for the materials of `embedding`; `unit` is the
    /// length of the forest's lattice unit (m).
    ///
    /// Cost: some hundred flops per tetrahedron that the forest bisects; 160 bytes for each around a
    /// vertex that leaves the middle, and while it is made 168 per heterogeneous tetrahedron.
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
        let means = embedding.mean_elasticities();
        let mut ring = Vec::new();
        for step in &mut mesh.steps {
            mesh.forest.ring_of(step.vertex, &mut ring);
            step.first = mesh.parents.len() as u32;
            add_parents(&mesh.forest, &means, &ring, unit, &mut mesh.parents);
            step.count = (mesh.parents.len() - step.first as usize) as u8;
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
        for parent in self.parents_of(step).iter().filter(|parent| parent.pulls()) {
            let geometry = lattice_geometry(&self.forest, &parent.corners);
            let f = geometry.gradient(&parent.corners.map(|v| x[v.index()])) / self.unit;
            let r = rotation(&f);
            let strain = strain_from_gradient(&(r.transpose() * f - Matrix3::identity()));
            offset += r * (parent.midpoint * strain);
        }
        // No sum, no rounding: a middle stays one to the last bit.
        if step.count == 0 { middle } else { middle + self.held_back(offset, step, [a, b], x) }
    }

    /// The most of `offset` by which every half keeps [`LEAST_HALF`] of its volume; nothing where a
    /// tetrahedron has none.
    ///
    /// With M displaced by d the half at a has 1 + 2 d·F⁻ᵀ∇λ_b times the volume that it has with M in
    /// the middle.
    fn held_back(
        &self,
        offset: Vector3<f64>,
        step: &Step,
        ends: [VertexId; 2],
        x: &[Vector3<f64>],
    ) -> Vector3<f64> {
        let mut most_lost = 0.0_f64;
        for parent in self.parents_of(step) {
            let geometry = lattice_geometry(&self.forest, &parent.corners);
            let f = geometry.gradient(&parent.corners.map(|v| x[v.index()]));
            let inverse = f.try_inverse().filter(|_| f.determinant() > 0.0);
            let Some(inverse) = inverse else { return Vector3::zeros() };
            let is_end = |corner: &usize| ends.contains(&parent.corners[*corner]);
            for corner in (0..4).filter(is_end) {
                let lost = -2.0 * geometry.gradients[corner].dot(&(inverse * offset));
                most_lost = most_lost.max(lost);
            }
        }
        let bearable = 1.0 - LEAST_HALF;
        if most_lost > bearable { offset * (bearable / most_lost) } else { offset }
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

/// Appends the tetrahedra around a bisected edge if any of them pulls its vertex from the middle.
fn add_parents(
    forest: &BisectionForest,
    means: &MeanElasticities<'_>,
    ring: &[Tet],
    unit: f64,
    parents: &mut Vec<EmbeddedParent>,
) {
    let first = parents.len();
    let mut stiffness = Matrix3::zeros();
    for tet in ring {
        let geometry = lattice_geometry(forest, &tet.vertices);
        let elasticity = forest.tree().children(tet.node).map(|half| means.of(half));
        let pair = ChildPair::new(&geometry, 0, bisected_corner(tet.level), elasticity);
        let (a, c) = pair.midpoint_energy();
        stiffness += a;
        let holds_void = forest.tree().labels(tet.node).as_slice()[0] == 0;
        let pull = if holds_void { SMatrix::zeros() } else { -unit * c.transpose() };
        parents.push(EmbeddedParent { corners: tet.vertices, midpoint: pull });
    }
    if !parents[first..].iter().any(EmbeddedParent::pulls) {
        return parents.truncate(first);
    }
    // Positive definite materials have an inverse.
    let compliance = stiffness.try_inverse().unwrap_or_else(Matrix3::zeros);
    parents[first..].iter_mut().for_each(|parent| parent.midpoint = compliance * parent.midpoint);
}
