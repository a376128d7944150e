//! The stage from positions to internal forces.

use super::tangent::TangentOf;
use crate::body::Body;
use crate::field::Field;

/// How internal forces follow from positions.
///
/// One that is a choice of each element's rotation calls
/// [`Body::forces_with_rotations`], which does all the rest; `sim/examples/own_forces.rs` does so.
/// The rotations that it leaves in the body are read by solvers (they turn the inverse with the
/// vertices), by stresses, by indicators and by output.
///
/// Forces of one's own, of springs along the edges of a body of one tetrahedron:
/// ```
/// use nalgebra::Vector3;
/// use yawara_corot::{Body, InternalForces};
///
/// /// k (‖x_j − x_i‖ − L) along each edge, L its length at rest.
/// struct Springs { k: f64, rest: [Vector3<f64>; 4] }
///
/// impl InternalForces for Springs {
///     fn name(&self) -> &'static str {
///         "springs"
///     }
///     fn internal_forces(&self, _: &mut Body, x: &[Vector3<f64>], f: &mut [Vector3<f64>]) -> f64 {
///         f.fill(Vector3::zeros());
///         for (i, j) in (0..4).flat_map(|j| (0..j).map(move |i| (i, j))) {
///             let (edge, length) = (x[j] - x[i], (self.rest[j] - self.rest[i]).norm());
///             let pull = self.k * (edge.norm() - length) * edge.normalize();
///             f[i] -= pull;
///             f[j] += pull;
///         }
///         f.iter().map(Vector3::norm_squared).sum::<f64>().sqrt()
///     }
/// }
///
/// let rest = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
/// let springs = Springs { k: 10.0, rest };
/// let mut forces = [Vector3::zeros(); 4];
/// springs.internal_forces(&mut Body::new(), &rest.map(|x| 2.0 * x), &mut forces);
/// // Twice as long: each edge of 1 m pulls at the corner in the origin with 10 N.
/// assert!((forces[0] + Vector3::repeat(10.0)).norm() < 1e-14);
/// ```
pub trait InternalForces: Send + Sync {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Adds nothing, overwrites `forces` with f_int(x) (N, one per vertex number) and renews the
    /// rotations of `body`. Returns √Σ_e ‖f_e‖², the scale against which residuals are measured.
    ///
    /// Cost: O(elements).
    fn internal_forces(&self, body: &mut Body, positions: &Field, forces: &mut Field) -> f64;

    /// ∂f_int/∂x by element at its stored rotation under the body's law, if there is such a thing.
    fn tangent(&self) -> Option<TangentOf<'_>> {
        None
    }

    /// Whether it reads the pressures of a [mixed](Body::mixed) body; without it they stay out of
    /// its forces.
    fn carries_pressures(&self) -> bool {
        false
    }

    /// Whether each element's rotation is the one nearest to its deformation gradient, wherever the body
    /// is, as [`Body::energy_of`] has to know.
    fn turns(&self) -> bool {
        true
    }

    /// A bound on the entries of ∂f_int/∂x, N/m: what rounding of positions does to forces goes
    /// with it.
    fn stiffness_scale(&self, body: &Body) -> f64 {
        body.stiffness_scale()
    }
}
