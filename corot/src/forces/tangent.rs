//! The derivative of a co-rotated element's forces, rotation included.

use nalgebra::allocator::Allocator;
use nalgebra::{
    DefaultAllocator, DimDiff, DimSub, Matrix3, Matrix6, OMatrix, OVector, SMatrix, SVector,
    SymmetricEigen, U1, Vector3, Vector6,
};
use yawara_embed::strain_from_gradient;

use crate::body::Body;
use crate::element::tetrahedron::stress_matrix;
use crate::element::turning::{axial, inverse_of_turning};
use crate::field::Field;

/// ∂f_a/∂x_b of the four corners, 12×12, corner-major x, y, z.
pub type ElementTangent = SMatrix<f64, 12, 12>;

/// The tangent, N/m, of the element with a number in a body at positions (m, by vertex number).
pub type TangentOf<'a> = Box<dyn Fn(&Body, usize, &Field) -> ElementTangent + Sync + 'a>;

/// What an eigenvalue may be below zero, as part of the trace.
pub(crate) const ROUNDING: f64 = 1e-13;

/// The least curvature that changes of the stretch get where one of them has none, as part of the largest: with far
/// less, what they have to do with turning counts for too much, and bodies turned inside out don't find their way.
const LEAST_CURVATURE: f64 = 1e-2;

/// The exact tangent of f_a = V R (σ − b×) ∇λ_a of element `number` under the law σ of `body`, of the strain
/// sym(RᵀF − I), at the stored rotation R, which must be that of F.
///
/// With F moving along M in the frame of R: ω = (tr(S)I − S)⁻¹ axial(M) turns R, S = RᵀF changes by N = M − ω×S,
/// and the energy's second derivative is V (N:C N − 2 ω·axial(A N) + ω·Γ ω), C = ∂σ/∂ε, A = σ − b×,
/// Γ = tr(A S) I − A S. Symmetric where C is. N/m.
///
/// # Panics
/// If `number` is not below the number of the body's elements.
pub fn element_tangent(body: &Body, number: usize, positions: &Field) -> ElementTangent {
    let (stress, modulus) = body.response(number, positions);
    let motions = Motions::new(body, number, positions);
    let (s, turning) = (&motions.stretch, &motions.turning);
    let stress = stress_matrix(&stress);
    let acting = stress - (turning * axial(&(stress * s))).cross_matrix();
    let mut second = SMatrix::<f64, 9, 9>::zeros();
    second.fixed_view_mut::<6, 6>(0, 0).copy_from(&modulus);
    for j in 0..6 {
        let across = -turning * axial(&(acting * stretch_of(j)));
        second.fixed_view_mut::<3, 1>(6, j).copy_from(&across);
        second.fixed_view_mut::<1, 3>(j, 6).copy_from(&across.transpose());
    }
    let moment = acting * s;
    let turned = turning * (Matrix3::identity() * moment.trace() - moment) * turning;
    second.fixed_view_mut::<3, 3>(6, 6).copy_from(&(0.5 * (turned + turned.transpose())));
    motions.of_corners.tr_mul(&(second * motions.of_corners))
        * body.elements()[number].geometry.volume
}

/// How an element moves but for moving along as a whole: six numbers for the change N of its stretch, in Voigt
/// order, three for axial(M), which turns it.
struct Motions {
    stretch: Matrix3<f64>,
    /// (tr(S)I − S)⁻¹, bounded.
    turning: Matrix3<f64>,
    /// The nine of a motion of the corners.
    of_corners: SMatrix<f64, 9, 12>,
}

impl Motions {
    fn new(body: &Body, number: usize, positions: &Field) -> Self {
        let element = &body.elements()[number];
        let (r, gradients) = (body.rotation(number), &element.geometry.gradients);
        let stretch = r.transpose() * element.deformation_gradient(positions);
        let turning = inverse_of_turning(&stretch);
        let mut of_corners = SMatrix::<f64, 9, 12>::zeros();
        for axis in 0..3 {
            let along = r.row(axis).transpose();
            for corner in 1..4 {
                let m = along * gradients[corner].transpose();
                let turned = axial(&m);
                let n = m - (turning * turned).cross_matrix() * stretch;
                let mut column = of_corners.fixed_view_mut::<9, 1>(0, 3 * corner + axis);
                column.fixed_rows_mut::<6>(0).copy_from(&strain_from_gradient(&n));
                column.fixed_rows_mut::<3>(6).copy_from(&turned);
            }
            let all: SVector<f64, 9> =
                (1..4).map(|corner| of_corners.column(3 * corner + axis).into_owned()).sum();
            of_corners.set_column(axis, &-all);
        }
        Self { stretch, turning, of_corners }
    }

    /// Motions of corners 1, 2 and 3 with one of the nine equal to one and all others zero, by columns; None for a flat element.
    fn with_one(&self, body: &Body, number: usize) -> Option<SMatrix<f64, 9, 9>> {
        let [_, g1, g2, g3] = body.elements()[number].geometry.gradients;
        // e_a with ∇λ_a·e_b = δ_ab.
        let edges = Matrix3::from_rows(&[g1.transpose(), g2.transpose(), g3.transpose()]);
        let edges = edges.try_inverse()?;
        let mut motions = SMatrix::<f64, 9, 9>::zeros();
        for j in 0..9 {
            let m = if j < 6 {
                stretch_of(j)
            } else {
                let turned = Vector3::ith(j - 6, 1.0);
                let stretched = (self.turning * turned).cross_matrix() * self.stretch;
                0.5 * (stretched + stretched.transpose() + turned.cross_matrix())
            };
            let moved = body.rotation(number) * m * edges;
            motions.column_mut(j).copy_from_slice(moved.as_slice());
        }
        Some(motions)
    }
}

/// The symmetric matrix whose Voigt strain has entry `j` one and no other.
fn stretch_of(j: usize) -> Matrix3<f64> {
    let strain = Vector6::ith(j, if j < 3 { 1.0 } else { 0.5 });
    stress_matrix(&strain)
}

/// A vector on the corners of an element, corner-major x, y, z.
pub(crate) type CornerVector = SVector<f64, 12>;

/// Calls `visit` with vectors d: Σ d dᵀ makes a tangent of element `number`, with it, positive semi-definite. None where
/// it is. The tangent must be symmetric, and one that moving along as a whole costs nothing.
///
/// Changes of the stretch come first: what curves down among them is made to curve up a little. What the tangent then
/// still lacks is at most of rank three: of its part for turning, minimised over changes of the stretch.
pub(crate) fn each_dent(
    tangent: &ElementTangent,
    (body, number): (&Body, usize),
    positions: &Field,
    mut visit: impl FnMut(CornerVector),
) {
    let motions = Motions::new(body, number, positions);
    let Some(with_one) = motions.with_one(body, number) else { return };
    let second = with_one.tr_mul(&(tangent.fixed_view::<9, 9>(3, 3) * with_one));
    let mut stretching: Matrix6<f64> = second.fixed_view::<6, 6>(0, 0).into_owned();
    let across: SMatrix<f64, 6, 3> = second.fixed_view::<6, 3>(0, 6).into_owned();
    let turning: Matrix3<f64> = second.fixed_view::<3, 3>(6, 6).into_owned();
    let rounding = ROUNDING * second.trace().abs();
    let mut corners = |part: usize, dent: &[f64]| {
        let mut motion = SVector::<f64, 9>::zeros();
        motion.as_mut_slice()[part..][..dent.len()].copy_from_slice(dent);
        visit(motions.of_corners.tr_mul(&motion));
    };
    let factor = stretching.cholesky().or_else(|| {
        let SymmetricEigen { eigenvectors, eigenvalues } = stretching.symmetric_eigen();
        let least = LEAST_CURVATURE * eigenvalues.amax();
        for (vector, value) in eigenvectors.column_iter().zip(&eigenvalues) {
            if *value < least {
                let dent: Vector6<f64> = vector * (least - value).sqrt();
                stretching += dent * dent.transpose();
                corners(0, dent.as_slice());
            }
        }
        stretching.cholesky()
    });
    let Some(factor) = factor else { return };
    let least_turning = turning - across.tr_mul(&factor.solve(&across));
    each_lack(least_turning, rounding, |lack| corners(6, lack.as_slice()));
}

/// Calls `visit` with vectors d: the least Σ d dᵀ that makes the symmetric part of a matrix, with it, positive
/// semi-definite but for eigenvalues that are `rounding` below zero.
pub(crate) fn each_lack<D>(
    matrix: OMatrix<f64, D, D>,
    rounding: f64,
    mut visit: impl FnMut(OVector<f64, D>),
) where
    D: DimSub<U1>,
    DefaultAllocator: Allocator<D> + Allocator<D, D> + Allocator<DimDiff<D, U1>>,
{
    let matrix = (&matrix + matrix.transpose()) * 0.5;
    let mut raised = matrix.clone();
    (0..matrix.nrows()).for_each(|i| raised[(i, i)] += rounding);
    if raised.cholesky().is_some() {
        return;
    }
    let SymmetricEigen { eigenvectors, eigenvalues } = matrix.symmetric_eigen();
    for (vector, value) in eigenvectors.column_iter().zip(&eigenvalues) {
        if *value < -rounding {
            visit(vector * (-value).sqrt());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ElementReference, InternalForces};
    use nalgebra::{Matrix6, Rotation3, Vector3};
    use proptest::prelude::*;
    use yawara_embed::isotropic;

    fn forces(body: &mut Body, x: &[Vector3<f64>]) -> [f64; 12] {
        let mut forces = [Vector3::zeros(); 4];
        ElementReference.internal_forces(body, x, &mut forces);
        std::array::from_fn(|i| forces[i / 3][i % 3])
    }

    proptest! {
        #[test]
        fn with_its_dents_a_tangent_is_semi_definite(
            shake in proptest::array::uniform12(-1.5..1.5f64),
            fibres in proptest::array::uniform32(-1.0..1.0f64),
            softened in proptest::option::of(0..6usize),
        ) {
            let m = Matrix6::from_fn(|i, j| fibres[(6 * i + j) % 32]);
            let mut elasticity = isotropic(1.0, 0.3) + m * m.transpose();
            if let Some(axis) = softened {
                // A law past its limit point.
                elasticity[(axis, axis)] = -0.5;
            }
            let (mut body, mut x) = Body::new().of_one(elasticity);
            for (x, off) in x.iter_mut().zip(shake.chunks(3)) {
                *x += Vector3::from_column_slice(off);
            }
            forces(&mut body, &x);
            let tangent = element_tangent(&body, 0, &x);
            let (mut raised, mut count) = (tangent, 0);
            each_dent(&tangent, (&body, 0), &x, |dent| {
                raised += dent * dent.transpose();
                count += 1;
            });
            let bar = 1e-11 * raised.amax();
            let least = raised.symmetric_eigenvalues().min();
            prop_assert!(least > -bar, "{} of {}", least, raised.amax());
            let own = tangent.symmetric_eigenvalues();
            let lacking = own.iter().filter(|value| **value < -bar).count();
            if own.min() > -1e-14 * tangent.amax() {
                prop_assert_eq!(count, 0);
            } else if softened.is_none() {
                prop_assert!(lacking <= count && count <= 3, "{} for {}", count, lacking);
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
