//! The stage that says what the vertices of a tetrahedron carry.

use faer::Mat;
use nalgebra::{Matrix6, SMatrix, SVector, Vector3};
use yawara_mesh::{MeshDelta, VertexId};

use crate::embedding::Embedding;
use crate::hand_over::{Halved, RingPart, RingStiffness};
use crate::linear_tet::LinearTet;

/// What a tetrahedron's vertices carry, and the symmetric matrix that couples them.
///
/// Unknowns are vertex-major: three displacements x, y, z first, others behind them. One file per
/// element; [`formulation_by_name`](crate::formulation_by_name) makes them by name.
///
/// An element of one's own, `p1` with all of its stiffness multiplied:
/// ```
/// use faer::{Mat, Scale};
/// use nalgebra::{Matrix6, Vector3};
/// use yawara_embed::{ElementFormulation, Halved, LinearTet, P1, RingPart, isotropic};
///
/// struct Times(f64);
///
/// impl ElementFormulation for Times {
///     fn name(&self) -> &'static str {
///         "times"
///     }
///     fn unknowns(&self) -> usize {
///         3
///     }
///     fn negative(&self) -> usize {
///         0
///     }
///     fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64> {
///         P1.stiffness(geometry, &(elasticity * self.0))
///     }
///     fn part(&self, halved: &Halved) -> RingPart {
///         P1.part(halved).scaled(self.0)
///     }
/// }
///
/// let tet = LinearTet::new(&[Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()]);
/// let [once, thrice] = [1.0, 3.0].map(|by| Times(by).stiffness(&tet, &isotropic(1e3, 0.3)));
/// assert!((&once * Scale(3.0) - thrice).norm_max() < 1e-9);
/// ```
pub trait ElementFormulation: Send + Sync {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Unknowns m per vertex: 3 displacements and what comes behind them.
    fn unknowns(&self) -> usize;

    /// How many of them, at the end, have negative pivots: 0 for a positive definite matrix.
    fn negative(&self) -> usize;

    /// The element's matrix on its four corners, 4m × 4m, symmetric; N/m.
    ///
    /// `elasticity` has to be symmetric positive definite (Pa); another one gives NaN, which every
    /// assembly refuses. Cost: some thousand flops.
    fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64>;

    /// The matrix that the inverse is of, in the same unknowns: the stiffness, and what else the
    /// element has of `density_kg_m3`; N/m.
    fn matrix(
        &self,
        geometry: &LinearTet,
        elasticity: &Matrix6<f64>,
        density_kg_m3: f64,
    ) -> Mat<f64> {
        let _ = density_kg_m3;
        self.stiffness(geometry, elasticity)
    }

    /// The share of one parent, and of its halves, in the hand-over of a split or merge.
    ///
    /// Cost: some thousand flops.
    fn part(&self, halved: &Halved) -> RingPart;

    /// The hand-over of a split or merge to the inverse; `position` gives rest positions (m) of
    /// old vertices.
    ///
    /// Cost: that of [`part`](Self::part) per ring tetrahedron.
    fn ring(
        &self,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness {
        let part = |halved: &Halved| self.part(halved);
        RingStiffness::assemble(self.unknowns(), delta, embedding, position, part)
    }
}

/// A matrix of fixed shape as one of any.
pub(super) fn dense<const R: usize, const C: usize>(matrix: &SMatrix<f64, R, C>) -> Mat<f64> {
    Mat::from_fn(R, C, |i, j| matrix[(i, j)])
}

/// A matrix of these columns.
pub(super) fn columns<const R: usize>(columns: &[SVector<f64, R>]) -> Mat<f64> {
    Mat::from_fn(R, columns.len(), |i, j| columns[j][i])
}
