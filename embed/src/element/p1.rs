//! `p1`: displacements alone, linear in every tetrahedron.

use faer::Mat;
use nalgebra::{Matrix3, Matrix6, SVector, Vector3};
use yawara_mesh::{MeshDelta, VertexId};

use super::formulation::ElementFormulation;
use crate::embedding::Embedding;
use crate::hand_over::{Halved, RingPart, RingStiffness};
use crate::linear_tet::LinearTet;

/// K = V BᵀDB on the displacements of four corners.
///
/// Locks from a Poisson ratio of .45 on: volume is kept tetrahedron by tetrahedron, which leaves
/// too few ways to move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct P1;

impl ElementFormulation for P1 {
    fn name(&self) -> &'static str {
        "p1"
    }

    fn unknowns(&self) -> usize {
        3
    }

    fn negative(&self) -> usize {
        0
    }

    fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64> {
        let k = geometry.stiffness(elasticity);
        Mat::from_fn(12, 12, |i, j| k[(i, j)])
    }

    fn ring(
        &self,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness {
        RingStiffness::assemble(delta, embedding, position, part)
    }
}

/// The share of one parent. M = F Fᵀ − B A22⁻¹Bᵀ with F from ½(D₁+D₂) − D_p, the excess of the
/// homogenisation.
pub(crate) fn part(halved: &Halved) -> RingPart<3, 12> {
    let Halved { geometry, pair, .. } = halved;
    let strain = geometry.strain_matrix().transpose();
    let half = 0.5 * geometry.volume;
    let mut part = RingPart {
        parent: geometry.stiffness(&halved.elasticity),
        straight: geometry.stiffness(&pair.mean_elasticity()),
        coupling: nalgebra::SMatrix::zeros(),
        own: Matrix3::zeros(),
        positive: Vec::new(),
        negative: Vec::new(),
        edge: SVector::zeros(),
    };
    let mut stresses = nalgebra::SMatrix::<f64, 6, 3>::zeros();
    for (g, d) in pair.strain_operators().iter().zip(&pair.elasticity) {
        let stress = half * d * g;
        part.own += g.transpose() * stress;
        stresses += stress;
    }
    part.coupling = strain * stresses;
    let root_volume = geometry.volume.sqrt();
    let [softer, stiffer] = halved.excess_factors();
    let columns = |factors: Vec<SVector<f64, 6>>| {
        factors.iter().map(|e| strain * e * root_volume).collect::<Vec<_>>()
    };
    part.positive = columns(softer);
    part.negative = columns(stiffer);
    part
}
