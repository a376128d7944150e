//! The derivative of a co-rotated element's forces, rotation included.

use nalgebra::{Matrix3, SMatrix, Vector3};
use yawara_embed::strain_from_gradient;

use crate::body::Element;
use crate::stress::stress_matrix;

/// ∂f_a/∂x_b of the four corners, 12×12, corner-major x, y, z.
pub type ElementTangent = SMatrix<f64, 12, 12>;

/// Eigenvalues of tr(S)I − S are kept this far from zero, relative to the largest.
const FLOOR: f64 = 1e-6;

/// The exact tangent of f_a = V R σ ∇λ_a, σ = D sym(RᵀF − I), at the stored rotation R, which must
/// be that of F.
///
/// With x_b moving along the local axis e_k: M = e_k ∇λ_bᵀ,
/// ω = (tr(S)I − S)⁻¹ (M₃₂−M₂₃, M₁₃−M₃₁, M₂₁−M₁₂) turns R, S = RᵀF changes by N = M − [ω]S,
/// and f_a by V R ([ω]σ + σ(N)) ∇λ_a. Symmetric for isotropic D. N/m.
pub fn element_tangent(element: &Element, positions: &[Vector3<f64>]) -> ElementTangent {
    let (r, gradients) = (&element.rotation, &element.geometry.gradients);
    let s = r.transpose() * element.deformation_gradient(positions);
    let strain = strain_from_gradient(&(s - Matrix3::identity()));
    let stress = stress_matrix(&(element.elasticity * strain));
    let turning = inverse_of_turning(&s);
    let mut tangent = ElementTangent::zeros();
    for b in 0..4 {
        for k in 0..3 {
            let mut m = Matrix3::zeros();
            m.set_row(k, &gradients[b].transpose());
            let skew = Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12);
            let omega = (turning * skew).cross_matrix();
            let n = m - omega * s;
            let change = stress_matrix(&(element.elasticity * strain_from_gradient(&n)));
            let local = (omega * stress + change) * element.geometry.volume;
            for a in 0..4 {
                tangent.fixed_view_mut::<3, 1>(3 * a, 3 * b + k).copy_from(&(local * gradients[a]));
            }
        }
    }
    // From the element's frame to the world's.
    for a in 0..4 {
        for b in 0..4 {
            let block = tangent.fixed_view::<3, 3>(3 * a, 3 * b).into_owned();
            let world = r * block * r.transpose();
            tangent.fixed_view_mut::<3, 3>(3 * a, 3 * b).copy_from(&world);
        }
    }
    tangent
}

/// (tr(S)I − S)⁻¹ with its eigenvalues kept away from zero: flat and inverted elements have some
/// there or below.
fn inverse_of_turning(s: &Matrix3<f64>) -> Matrix3<f64> {
    let symmetric = 0.5 * (s + s.transpose());
    let turning = Matrix3::identity() * symmetric.trace() - symmetric;
    let mut eigen = turning.symmetric_eigen();
    let floor = FLOOR * eigen.eigenvalues.amax().max(f64::MIN_POSITIVE / FLOOR);
    for value in eigen.eigenvalues.iter_mut() {
        *value = 1.0 / if value.abs() < floor { floor } else { *value };
    }
    eigen.recompose()
}

/// The nearest symmetric positive semi-definite matrix to the symmetric part.
pub(crate) fn convex_part(tangent: &ElementTangent) -> ElementTangent {
    let mut eigen = (0.5 * (tangent + tangent.transpose())).symmetric_eigen();
    eigen.eigenvalues.iter_mut().for_each(|value| *value = value.max(0.0));
    eigen.recompose()
}
