//! An element in a time step: its stiffness, mass and damping in one matrix.

use faer::Mat;
use nalgebra::{Matrix6, Vector3};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{MeshDelta, VertexId};

use super::formulation::ElementFormulation;
use super::mass::{Mass, signed_pair};
use super::p1::{self, P1};
use super::p1p1::P1P1;
use crate::embedding::Embedding;
use crate::error::EmbedError;
use crate::hand_over::{Halved, RingPart, RingStiffness};
use crate::linear_tet::LinearTet;

/// The weights of an element's mass and stiffness in a time step: the effective matrix is s K + c M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepWeights {
    /// How mass lies on the corners.
    pub mass: Mass,
    /// c, 1/s²: of the time integrator.
    pub mass_per_s2: f64,
    /// s: of the constitutive law, 1 for linear elasticity.
    pub stiffness: f64,
}

impl StepWeights {
    /// With c ≥ 0 and s > 0.
    ///
    /// # Errors
    /// [`EmbedError::StepWeight`] for other values, NaN and infinity among them.
    pub fn new(mass: Mass, mass_per_s2: f64, stiffness: f64) -> Result<Self, EmbedError> {
        let refuse = |what, value, want| Err(EmbedError::StepWeight { what, value, want });
        if !(mass_per_s2 >= 0.0 && mass_per_s2.is_finite()) {
            return refuse("weight of the mass, 1/s²,", mass_per_s2, "a finite number >= 0");
        }
        if !(stiffness > 0.0 && stiffness.is_finite()) {
            return refuse("weight of the stiffness", stiffness, "a finite number > 0");
        }
        Ok(Self { mass, mass_per_s2, stiffness })
    }
}

/// An element with its mass: s K + c M, M on the displacements alone. Under damping by stiffness
/// pressures are damped as all stress is, so that s multiplies the whole matrix of `p1p1`.
///
/// With [`Mass::Consistent`] a split changes the matrix by the rank of the element alone where
/// densities do not differ. Where they do, the homogenised parent has the mean of its halves and
/// their mass leans to one end of the edge: that adds three columns of either sign for the whole
/// ring. [`Mass::Lumped`] adds −(ρV/16) c (e_a − e_b)(e_a − e_b)ᵀ: three negative ones,
/// and as many positive where densities differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamic<E> {
    element: E,
    weights: StepWeights,
}

impl Dynamic<P1> {
    /// Displacements alone.
    pub fn new(weights: StepWeights) -> Self {
        Self { element: P1, weights }
    }
}

impl Dynamic<P1P1> {
    /// Displacements with mass, pressures without.
    pub fn mixed(element: P1P1, weights: StepWeights) -> Self {
        Self { element, weights }
    }
}

/// An element whose ring's parts take mass, each by itself.
trait TakesMass: ElementFormulation {
    /// The ring of s K + c M, but for the mass by which halves differ from their parents.
    fn weighted_ring(
        &self,
        weights: &StepWeights,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness;
}

impl TakesMass for P1 {
    fn weighted_ring(
        &self,
        weights: &StepWeights,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness {
        let part = |halved: &Halved| weights.part(p1::part(halved), halved);
        RingStiffness::assemble(delta, embedding, position, part)
    }
}

impl TakesMass for P1P1 {
    fn weighted_ring(
        &self,
        weights: &StepWeights,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness {
        let part = |halved: &Halved| weights.part(self.part(halved), halved);
        RingStiffness::assemble(delta, embedding, position, part)
    }
}

impl<E: TakesMass> ElementFormulation for Dynamic<E> {
    fn name(&self) -> &'static str {
        self.element.name()
    }

    fn unknowns(&self) -> usize {
        self.element.unknowns()
    }

    fn negative(&self) -> usize {
        self.element.negative()
    }

    fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64> {
        self.element.stiffness(geometry, elasticity)
    }

    fn matrix(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>, density: f64) -> Mat<f64> {
        self.weights.matrix(self.stiffness(geometry, elasticity), geometry.volume * density)
    }

    fn ring(
        &self,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness {
        let ring = self.element.weighted_ring(&self.weights, delta, embedding, position);
        self.weights.add_excess(ring, delta, embedding, position)
    }
}

impl StepWeights {
    /// s K + c M of an element's matrix on four corners.
    fn matrix(&self, mut k: Mat<f64>, mass_kg: f64) -> Mat<f64> {
        let m = k.nrows() / 4;
        let mass = self.mass.matrix(mass_kg) * self.mass_per_s2;
        k *= faer::Scale(self.stiffness);
        for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
            for axis in 0..3 {
                k[(m * i + axis, m * j + axis)] += mass[(i, j)];
            }
        }
        k
    }

    /// s times the part of a parent, with c times its mass.
    fn part<const M: usize, const N: usize>(
        &self,
        part: RingPart<M, N>,
        halved: &Halved,
    ) -> RingPart<M, N> {
        let mut part = part.scaled(self.stiffness);
        self.mass.add_to(&mut part, halved, self.mass_per_s2);
        part
    }

    /// Gives the ring the columns by which its halves' mass differs from the parents': the same
    /// edge in all parents, hence one product for the whole ring.
    fn add_excess(
        &self,
        mut ring: RingStiffness,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness {
        let row = |v: VertexId| ring.vertices.binary_search(&v).unwrap_or_default();
        let [a, b] = delta.edge;
        let mut x = vec![0.0; ring.vertices.len()];
        let mut y = vec![0.0; ring.vertices.len()];
        (x[row(a)], x[row(b)]) = (1.0, -1.0);
        for tet in &delta.ring {
            let halved = Halved::new(&tet.parent, embedding, position);
            let from_a = tet.parent.vertices[0] == a;
            debug_assert!(from_a || tet.parent.vertices[bisected_corner(tet.parent.level)] == a);
            let sign = if from_a { self.mass_per_s2 } else { -self.mass_per_s2 };
            let excess = self.mass.excess(&halved);
            for (v, y_v) in tet.parent.vertices.iter().zip(excess.iter()) {
                y[row(*v)] += sign * y_v;
            }
        }
        let m = ring.a22.nrows();
        let [positive, negative] = signed_pair(&x, &y);
        append(&mut ring.positive, positive, m);
        append(&mut ring.negative, negative, m);
        ring
    }
}

/// Appends `column` ⊗ I₃ on the displacements of m unknowns per vertex.
fn append(matrix: &mut Mat<f64>, column: Option<Vec<f64>>, m: usize) {
    let Some(column) = column else { return };
    let (rows, before) = (matrix.nrows(), matrix.ncols());
    matrix.resize_with(
        rows,
        before + 3,
        |i, j| {
            if i % m == j - before { column[i / m] } else { 0.0 }
        },
    );
}
