//! How the rotation of an element follows its stretch, and what that adds to its stress.

use nalgebra::{Matrix3, Vector3};

use super::tetrahedron::Element;
use crate::field::Field;

/// How an element's rotation belongs to its deformation gradient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turning {
    /// It is the nearest one, so that it turns with it.
    Nearest,
    /// It is any.
    Given,
}

impl Turning {
    /// The stress that does the work of σ in an element with a `rotation` at `positions`, in its
    /// frame: [`conjugate`] to its stretch where its rotation turns with it.
    pub fn stress(
        self,
        stress: &Matrix3<f64>,
        element: &Element,
        rotation: &Matrix3<f64>,
        positions: &Field,
    ) -> Matrix3<f64> {
        match self {
            Self::Given => *stress,
            Self::Nearest => {
                let f = element.deformation_gradient(positions);
                conjugate(stress, &(rotation.transpose() * f))
            }
        }
    }
}

/// (tr(S)I − S)⁻¹ counts det(tr(S)I − S) as no less than this part of tr(S)³: the rotation nearest to F
/// turns without bound where the two least singular values (the least with the sign of det F) have the sum
/// zero.
pub(crate) const LEAST: f64 = 1e-3;

/// (tr(S)I − S)⁻¹ of a symmetric stretch S = RᵀF, by cofactors.
pub(crate) fn inverse_of_turning(stretch: &Matrix3<f64>) -> Matrix3<f64> {
    let g = Matrix3::identity() * stretch.trace() - 0.5 * (stretch + stretch.transpose());
    let [x, y, z] = [0, 1, 2].map(|axis| g.row(axis).transpose());
    let cofactors = Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)]);
    let least = (LEAST * stretch.trace().powi(3)).max(f64::MIN_POSITIVE);
    cofactors / x.dot(&y.cross(&z)).max(least)
}

/// The axial vector of M − Mᵀ.
pub(crate) fn axial(m: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12)
}

/// σ − b×, b = (tr(S)I − S)⁻¹ axial(σ S), for the symmetric σ of a stretch S: V R times it is the derivative of
/// V ψ(S), σ = ∂ψ/∂S, by F, the turning of R with F included.
///
/// R itself where σ and S commute, as they do where the material is isotropic. It has no torque:
/// R (σ − b×) Fᵀ is symmetric.
pub(crate) fn conjugate(stress: &Matrix3<f64>, stretch: &Matrix3<f64>) -> Matrix3<f64> {
    let b = inverse_of_turning(stretch) * axial(&(stress * stretch));
    stress - b.cross_matrix()
}
