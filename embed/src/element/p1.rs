//! `p1`: displacements alone, linear in every tetrahedron.

use faer::Mat;
use nalgebra::{Matrix3, Matrix6, SMatrix};

use super::formulation::{ElementFormulation, columns, dense};
use crate::hand_over::{Halved, RingPart};
use crate::homogenisation::ChildPair;
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
        dense(&geometry.stiffness(elasticity))
    }

    /// `straight` − `parent` is that of the homogenisation's excess, ½(D₁+D₂) − D_p.
    fn part(&self, halved: &Halved) -> RingPart {
        let Halved { geometry, pair, .. } = halved;
        let (strain, root_volume) = (geometry.strain_matrix().transpose(), geometry.volume.sqrt());
        let [positive, negative] = halved.excess_factors().map(|factors| {
            columns(&factors.iter().map(|e| strain * e * root_volume).collect::<Vec<_>>())
        });
        let (coupling, own) = midpoint(geometry, pair);
        RingPart {
            parent: self.stiffness(geometry, &halved.elasticity),
            straight: self.stiffness(geometry, &pair.mean_elasticity()),
            coupling: dense(&coupling),
            own: dense(&own),
            positive,
            negative,
            edge: vec![0.0; 3],
            lean: [0.0; 4],
        }
    }
}

/// Σ V_c BᵀD_cG_c and Σ V_c G_cᵀD_cG_c of the halves: what a displacement d of the new vertex off
/// the middle of its edge has in common with the corners', and its own.
pub(super) fn midpoint(
    geometry: &LinearTet,
    pair: &ChildPair,
) -> (SMatrix<f64, 12, 3>, Matrix3<f64>) {
    let (mut stresses, mut own) = (SMatrix::<f64, 6, 3>::zeros(), Matrix3::zeros());
    for (g, d) in pair.strain_operators().iter().zip(&pair.elasticity) {
        let stress = 0.5 * geometry.volume * d * g;
        own += g.transpose() * stress;
        stresses += stress;
    }
    (geometry.strain_matrix().transpose() * stresses, own)
}
