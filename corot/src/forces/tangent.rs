//! The derivative of a co-rotated element's forces, rotation included.

use std::cmp::Ordering;

use nalgebra::{Const, DimMin, Matrix3, Matrix3x4, Matrix6, SMatrix, SVector, Vector3};
use yawara_embed::{Strain, strain_from_gradient};

use crate::body::Body;
use crate::element::tetrahedron::stress_matrix;
use crate::element::turning::{axial, inverse_of_turning};
use crate::field::Field;
use crate::kernels::jacobi::eigen;
use crate::kernels::simd::LANES;

/// ∂f_a/∂x_b of the four corners, 12×12, corner-major x, y, z.
pub type ElementTangent = SMatrix<f64, 12, 12>;

/// The tangent, N/m, of the element with a number in a body at positions (m, by vertex number).
pub type TangentOf<'a> = Box<dyn Fn(&Body, usize, &Field) -> ElementTangent + Sync + 'a>;

/// What an eigenvalue may be below zero, as part of the trace.
const ROUNDING: f64 = 1e-13;

/// The exact tangent of f_a = V R (σ − b×) ∇λ_a of element `number` under the law σ of `body`, of the strain
/// sym(RᵀF − I), at the stored rotation R, which must be that of F.
///
/// With x_b moving along the local axis e_k: M = e_k ∇λ_bᵀ, ω = (tr(S)I − S)⁻¹ axial(M) turns R, S = RᵀF changes
/// by N = M − ω×S, σ by C N, C = ∂σ/∂ε, b by (tr(S)I − S)⁻¹ (axial(C N S + σ N) − (tr(N)I − N) b), and f_a by
/// V R (ω×(σ − b×) + C N − δb×) ∇λ_a. Symmetric where C is. N/m.
///
/// # Panics
/// If `number` is not below the number of the body's elements.
pub fn element_tangent(body: &Body, number: usize, positions: &Field) -> ElementTangent {
    let (stress, modulus) = body.response(number, positions);
    tangent_of(body, number, positions, (&stress, &modulus), true)
}

/// The exact tangent of V R (σ − D ε) ∇λ_a, what the law of `body` has beyond D ε, as
/// [`Body::add_law_forces`] adds it; nothing under a linear law. N/m.
pub(super) fn beyond_tangent(body: &Body, number: usize, positions: &Field) -> ElementTangent {
    let element = &body.elements()[number];
    let (stress, modulus) = body.response(number, positions);
    let strain = element.corotated_strain(&body.rotation(number), positions);
    let (stress, modulus) = (stress - element.elasticity * strain, modulus - element.elasticity);
    if stress.amax() == 0.0 && modulus.amax() == 0.0 {
        return ElementTangent::zeros();
    }
    tangent_of(body, number, positions, (&stress, &modulus), false)
}

/// Of V R (σ − b×) ∇λ_a with σ and ∂σ/∂ε; b is zero where forces do not take part in the
/// work of turning.
fn tangent_of(
    body: &Body,
    number: usize,
    positions: &Field,
    (stress, modulus): (&Strain, &Matrix6<f64>),
    takes_part: bool,
) -> ElementTangent {
    let element = &body.elements()[number];
    let (r, gradients) = (body.rotation(number), &element.geometry.gradients);
    let s = r.transpose() * element.deformation_gradient(positions);
    let stress = stress_matrix(stress);
    let turning = inverse_of_turning(&s);
    let part = if takes_part { 1.0 } else { 0.0 };
    let b = part * (turning * axial(&(stress * s)));
    let acting = stress - b.cross_matrix();
    let by_corner = Matrix3x4::from_columns(gradients);
    // Along each axis of the world, and along each of the element's frame in which that may vary: by corners.
    let mut along = [[Matrix3x4::zeros(); 3]; 3];
    for (k, j) in (0..3).flat_map(|k| (0..3).map(move |j| (k, j))) {
        let mut m = Matrix3::zeros();
        m.set_column(j, &r.row(k).transpose());
        let omega = turning * axial(&m);
        let n = m - cross_columns(&omega, &s);
        let n = 0.5 * (n + n.transpose());
        let change = stress_matrix(&(modulus * strain_from_gradient(&n)));
        let moment = part * axial(&(change * s + stress * n)) - (b * n.trace() - n * b);
        let local = cross_columns(&omega, &acting) + change - (turning * moment).cross_matrix();
        along[k][j] = r * (local * element.geometry.volume) * by_corner;
    }
    let mut tangent = ElementTangent::zeros();
    for (corner, gradient) in gradients.iter().enumerate() {
        for (k, [x, y, z]) in along.iter().enumerate() {
            let forces = x * gradient.x + y * gradient.y + z * gradient.z;
            tangent.column_mut(3 * corner + k).copy_from_slice(forces.as_slice());
        }
    }
    tangent
}

/// ω× M.
fn cross_columns(omega: &Vector3<f64>, m: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&[0, 1, 2].map(|j| omega.cross(&m.column(j))))
}

/// A vector on the corners of an element, corner-major x, y, z.
pub(crate) type CornerVector = SVector<f64, 12>;

/// Calls `visit` with numbers of elements and vectors d: the least Σ d dᵀ that makes the symmetric part of an element's
/// tangent, with it, positive semi-definite. Tangents must be such that moving along as a whole costs nothing.
pub(crate) fn each_dent(tangents: &[ElementTangent], mut visit: impl FnMut(usize, CornerVector)) {
    // Most elements lack nothing, which shows where corner 0 stays as well.
    let is_lacking = |number: &usize| {
        let held: SMatrix<f64, 9, 9> = tangents[*number].fixed_view::<9, 9>(3, 3).into_owned();
        is_indefinite(&symmetric(&held)).is_some()
    };
    let lacking: Vec<_> = (0..tangents.len()).filter(is_lacking).collect();
    let shapes = shapes();
    let own: Vec<_> = lacking.iter().map(|&at| shapes.tr_mul(&(tangents[at] * shapes))).collect();
    each_lack(&own, |number, lack| visit(lacking[number], shapes * lack));
}

/// Of all that an element's corners may do but to move along as a whole, an orthonormal basis by columns: corner 1
/// away from 0, 2 away from both, 3 away from all three.
fn shapes() -> SMatrix<f64, 12, 9> {
    SMatrix::from_fn(|row, column| {
        let (corner, last) = (row / 3, column / 3 + 1);
        let entry = match corner.cmp(&last) {
            _ if row % 3 != column % 3 => 0.0,
            Ordering::Less => -1.0,
            Ordering::Equal => last as f64,
            Ordering::Greater => 0.0,
        };
        entry / ((last * (last + 1)) as f64).sqrt()
    })
}

/// Calls `visit` with numbers of matrices, in order, and vectors d: the least Σ d dᵀ that makes the symmetric part of a
/// matrix, with it, positive semi-definite.
pub(crate) fn each_lack<const N: usize>(
    matrices: &[SMatrix<f64, N, N>],
    mut visit: impl FnMut(usize, SVector<f64, N>),
) where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let is_lacking = |(number, matrix): (usize, &SMatrix<f64, N, N>)| {
        let matrix = symmetric(matrix);
        is_indefinite(&matrix).map(|rounding| (number, rounding, matrix))
    };
    let lacking: Vec<_> = matrices.iter().enumerate().filter_map(is_lacking).collect();
    for some in lacking.chunks(LANES) {
        let matrices: Vec<_> = some.iter().map(|(.., matrix)| *matrix).collect();
        for ((number, rounding, _), (values, vectors)) in some.iter().zip(eigen(&matrices)) {
            for (vector, value) in vectors.column_iter().zip(&values) {
                if *value < -rounding {
                    visit(*number, vector * (-value).sqrt());
                }
            }
        }
    }
}

fn symmetric<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (matrix + matrix.transpose()) * 0.5
}

/// What counts as zero in a symmetric matrix that is not positive semi-definite.
fn is_indefinite<const N: usize>(matrix: &SMatrix<f64, N, N>) -> Option<f64> {
    // To turn without a strain costs nothing either.
    let rounding = ROUNDING * matrix.trace().abs();
    let raised = matrix + SMatrix::identity() * rounding;
    raised.cholesky().is_none().then_some(rounding)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ElementReference, InternalForces};
    use nalgebra::Rotation3;
    use proptest::prelude::*;
    use yawara_embed::isotropic;

    fn forces(body: &mut Body, x: &[Vector3<f64>]) -> [f64; 12] {
        let mut forces = [Vector3::zeros(); 4];
        ElementReference.internal_forces(body, x, &mut forces);
        std::array::from_fn(|i| forces[i / 3][i % 3])
    }

    /// A tangent of random entries that moving along as a whole costs nothing.
    fn indefinite(entries: &[f64]) -> ElementTangent {
        let own = SMatrix::<f64, 9, 9>::from_fn(|i, j| entries[9 * i + j] + entries[9 * j + i]);
        shapes() * own * shapes().transpose()
    }

    proptest! {
        #[test]
        fn dents_are_what_a_tangent_lacks(
            entries in proptest::collection::vec(-1.0..1.0f64, 81),
            turned in any::<bool>(),
        ) {
            let mut tangent = indefinite(&entries);
            if turned {
                tangent *= tangent;
            }
            let (mut raised, mut count) = (tangent, 0);
            each_dent(&[tangent], |_, dent| {
                raised += dent * dent.transpose();
                count += 1;
            });
            let whole = tangent.symmetric_eigenvalues();
            let bar = 1e-12 * tangent.amax();
            prop_assert_eq!(count, whole.iter().filter(|value| **value < -bar).count());
            // What is there already stays, and what is missing becomes zero.
            let mut expected = whole.map(|value| value.max(0.0)).as_slice().to_vec();
            let mut found = raised.symmetric_eigenvalues().as_slice().to_vec();
            expected.sort_by(f64::total_cmp);
            found.sort_by(f64::total_cmp);
            for (found, expected) in found.iter().zip(&expected) {
                prop_assert!((found - expected).abs() < bar, "{} for {}", found, expected);
            }
        }

        #[test]
        fn it_is_the_derivative_of_the_forces(
            shake in proptest::array::uniform12(-0.3..0.3f64),
            turn in proptest::array::uniform3(-2.0..2.0f64),
            fibres in proptest::array::uniform32(-1.0..1.0f64),
        ) {
            let m = Matrix6::from_fn(|i, j| fibres[(6 * i + j) % 32]);
            for elasticity in [isotropic(1.0, 0.3), isotropic(1.0, 0.3) + m * m.transpose()] {
                let (mut body, mut x) = Body::new().of_one(elasticity);
                let r = Rotation3::from_scaled_axis(Vector3::from(turn));
                for (x, off) in x.iter_mut().zip(shake.chunks(3)) {
                    *x = r * (*x + Vector3::from_column_slice(off));
                }
                forces(&mut body, &x);
                // Away from where rotations jump.
                let s = body.elements()[0].deformation_gradient(&x);
                prop_assume!(s.determinant() > 0.05);
                let at = forces(&mut body, &x);
                let torque = |(x, f): (&Vector3<f64>, &[f64])| x.cross(&Vector3::from_column_slice(f));
                let net: Vector3<f64> = x.iter().zip(at.chunks(3)).map(torque).sum();
                let scale = at.iter().map(|f| f * f).sum::<f64>().sqrt();
                prop_assert!(net.norm() < 1e-12 * scale.max(1e-3), "torque {net:?}, forces {scale}");
                let tangent = element_tangent(&body, 0, &x);
                let h = 1e-5;
                for column in 0..12 {
                    let at = x[column / 3][column % 3];
                    x[column / 3][column % 3] = at + h;
                    let up = forces(&mut body, &x);
                    x[column / 3][column % 3] = at - h;
                    let down = forces(&mut body, &x);
                    x[column / 3][column % 3] = at;
                    for row in 0..12 {
                        let slope = (up[row] - down[row]) / (2.0 * h);
                        // Third derivatives grow with the curvature of the rotation.
                        let bar = 1e-5 * tangent.amax();
                        prop_assert!((slope - tangent[(row, column)]).abs() < bar);
                    }
                }
                let asymmetry = (tangent - tangent.transpose()).amax();
                prop_assert!(asymmetry < 1e-12 * tangent.amax());
            }
        }
    }
}
