//! One tetrahedron around a bisected edge, with its halves.

use nalgebra::{Matrix6, Vector3, Vector6};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{Tet, VertexId};

use crate::embedding::Embedding;
use crate::homogenisation::{ChildPair, Excess};
use crate::linear_tet::LinearTet;

/// A parent of the ring: its geometry, its own material and that of its halves.
#[derive(Clone, Copy, Debug)]
pub struct Halved {
    /// Rest geometry; corner 0 is one end a of the bisected edge.
    pub geometry: LinearTet,
    /// The corner that is the other end b.
    pub end: usize,
    /// Both halves.
    pub pair: ChildPair,
    /// Their mean densities, kg/m³; the parent's is the mean of both.
    pub density: [f64; 2],
    /// Elasticity D_p of the whole, Pa.
    pub elasticity: Matrix6<f64>,
    /// ½(D₁+D₂) − D_p.
    pub excess: Excess,
}

impl Halved {
    pub(crate) fn new(
        parent: &Tet,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> Self {
        let geometry = LinearTet::new(&parent.vertices.map(position));
        let (pair, combined) = embedding.combine(parent.node, &geometry, parent.level);
        Self {
            geometry,
            end: bisected_corner(parent.level),
            pair,
            density: embedding.tree().children(parent.node).map(|half| embedding.density(half)),
            elasticity: embedding.elasticity(parent.node),
            excess: combined.excess,
        }
    }

    /// The vectors e with ½(D₁+D₂) − D_p = Σ ± e eᵀ: those with a plus, those with a minus, √Pa.
    pub fn excess_factors(&self) -> [Vec<Vector6<f64>>; 2] {
        match &self.excess {
            Excess::Zero => [Vec::new(), Vec::new()],
            Excess::Rank3(factor) => {
                [factor.column_iter().map(|c| c.into_owned()).collect(), Vec::new()]
            }
            Excess::Unfactored => {
                let mut sides = [Vec::new(), Vec::new()];
                let eigen = (self.pair.mean_elasticity() - self.elasticity).symmetric_eigen();
                for (value, vector) in
                    eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter())
                {
                    if *value != 0.0 {
                        sides[usize::from(*value < 0.0)].push(vector * value.abs().sqrt());
                    }
                }
                sides
            }
        }
    }
}
