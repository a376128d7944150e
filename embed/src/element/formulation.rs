//! The stage that says what the vertices of a tetrahedron carry.

use faer::Mat;
use nalgebra::{Matrix6, Vector3};
use yawara_mesh::{MeshDelta, VertexId};

use crate::embedding::Embedding;
use crate::hand_over::RingStiffness;
use crate::linear_tet::LinearTet;

/// What a tetrahedron's vertices carry, and the symmetric matrix that couples them.
///
/// Unknowns are vertex-major: three displacements x, y, z first, others behind them. One file per
/// element; [`formulation_by_name`](crate::formulation_by_name) makes them by name.
///
/// An element of one's own, `p1` on an elastic bed:
/// ```
/// use faer::Mat;
/// use nalgebra::{Matrix6, Vector3};
/// use yawara_embed::{ElementFormulation, Embedding, LinearTet, P1, RingStiffness, isotropic};
/// use yawara_mesh::{MeshDelta, VertexId};
///
/// /// A bed of so many N/m⁴, a quarter of each tetrahedron's share on each corner.
/// struct Bedded(f64);
///
/// impl ElementFormulation for Bedded {
///     fn name(&self) -> &'static str {
///         "bedded"
///     }
///     fn unknowns(&self) -> usize {
///         3
///     }
///     fn negative(&self) -> usize {
///         0
///     }
///     fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64> {
///         let mut k = P1.stiffness(geometry, elasticity);
///         (0..12).for_each(|i| k[(i, i)] += 0.25 * self.0 * geometry.volume);
///         k
///     }
///     fn ring(
///         &self,
///         _: &MeshDelta,
///         _: &Embedding,
///         _: &dyn Fn(VertexId) -> Vector3<f64>,
///     ) -> RingStiffness {
///         unimplemented!("this body neither splits nor merges")
///     }
/// }
///
/// let tet = LinearTet::new(&[Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()]);
/// let k = Bedded(24.0).stiffness(&tet, &isotropic(1e3, 0.3));
/// // Moved along x as a whole by 1 m, only the bed resists: 24 N/m⁴ · 1/6 m³ · 1 m.
/// let force: f64 = (0..4).flat_map(|i| (0..4).map(move |j| (3 * i, 3 * j))).map(|at| k[at]).sum();
/// assert!((force - 4.0).abs() < 1e-9);
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

    /// The hand-over of a split or merge to the inverse; `position` gives rest positions (m) of
    /// old vertices.
    ///
    /// Cost: some thousand flops per ring tetrahedron.
    fn ring(
        &self,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
    ) -> RingStiffness;
}
