//! The rotation nearest to a deformation gradient.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// Eigenvalues of tr(S)I − S are kept at least this far from zero.
const EIGENVALUE_FLOOR: f64 = 1e-6;

/// The longest Newton step, rad.
const STEP_LIMIT: f64 = 1.0;

/// Steps shorter than this end the iteration, rad: the square of it is below rounding.
const STEP_DONE: f64 = 1e-9;

const MAX_STEPS: usize = 8;

/// The rotation R that maximises tr(RᵀF), from a nearby `start`.
///
/// Newton on SO(3): with M = RᵀF and S its symmetric part,
/// ω = (tr(S)I − S)⁻¹ (M₃₂−M₂₃, M₁₃−M₃₁, M₂₁−M₁₂), R ← R exp(ω×). Quadratic: three steps from
/// 20° off reach rounding. Where it ends in no maximum, or not at all, [`polar_cold`] decides.
/// A non-finite F leaves `start` as it is.
pub fn polar_warm(f: &Matrix3<f64>, start: &Matrix3<f64>) -> Matrix3<f64> {
    if !f.iter().all(|v| v.is_finite()) {
        return *start;
    }
    let mut r = *start;
    for _ in 0..MAX_STEPS {
        let m = r.transpose() * f;
        let skew = Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12);
        let s = 0.5 * (m + m.transpose());
        let hessian = Matrix3::identity() * s.trace() - s;
        let Some(chol) = hessian.cholesky() else {
            return polar_cold(f);
        };
        // The product of pivots squared bounds the smallest eigenvalue from both sides.
        let smallest = chol.l_dirty().diagonal().min().powi(2);
        if smallest < EIGENVALUE_FLOOR {
            return polar_cold(f);
        }
        let mut step = chol.solve(&skew);
        let length = step.norm();
        if length > STEP_LIMIT {
            step *= STEP_LIMIT / length;
        }
        r *= Rotation3::from_scaled_axis(step).matrix();
        if length < STEP_DONE {
            return renormalised(&r);
        }
    }
    polar_cold(f)
}

/// The same rotation without a start: R = U diag(1, 1, det UVᵀ) Vᵀ of F = U Σ Vᵀ, the sign on
/// the smallest singular value. Finite for inverted, flat and zero F.
pub fn polar_cold(f: &Matrix3<f64>) -> Matrix3<f64> {
    let scale = f.amax();
    if scale == 0.0 || !scale.is_finite() {
        return Matrix3::identity();
    }
    let svd = (f / scale).svd(true, true);
    let (Some(mut u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Matrix3::identity();
    };
    if (u * v_t).determinant() < 0.0 {
        let smallest = svd.singular_values.imin();
        u.column_mut(smallest).neg_mut();
    }
    renormalised(&(u * v_t))
}

/// One Newton-Schulz step takes rounding out of a product of rotations: R(3I − RᵀR)/2.
fn renormalised(r: &Matrix3<f64>) -> Matrix3<f64> {
    r * (Matrix3::identity() * 3.0 - r.transpose() * r) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn matrix() -> impl Strategy<Value = Matrix3<f64>> {
        proptest::array::uniform9(-1.5..1.5f64).prop_map(|a| Matrix3::from_row_slice(&a))
    }

    fn is_rotation(r: &Matrix3<f64>) -> bool {
        (r.transpose() * r - Matrix3::identity()).amax() < 1e-14 && r.determinant() > 0.0
    }

    proptest! {
        #[test]
        fn no_nearby_rotation_is_nearer(f in matrix(), w in proptest::array::uniform3(-1.0..1.0f64)) {
            let r = polar_cold(&f);
            prop_assert!(is_rotation(&r));
            for scale in [1e-3, 0.1, 1.0, 3.0] {
                let turn = Rotation3::from_scaled_axis(Vector3::from(w) * scale);
                let other = r * turn.matrix();
                prop_assert!((other.transpose() * f).trace() <= (r.transpose() * f).trace() + 1e-13);
            }
        }

        #[test]
        fn warm_equals_cold(
            stretch in proptest::array::uniform3(0.3..2.0f64),
            axis in proptest::array::uniform3(-3.0..3.0f64),
            off in proptest::array::uniform3(-0.25..0.25f64),
        ) {
            let r = Rotation3::from_scaled_axis(Vector3::from(axis)).into_inner();
            let basis = Rotation3::from_scaled_axis(Vector3::new(0.3, -0.8, 0.5)).into_inner();
            let s = basis * Matrix3::from_diagonal(&Vector3::from(stretch)) * basis.transpose();
            let start = r * Rotation3::from_scaled_axis(Vector3::from(off)).matrix();
            let warm = polar_warm(&(r * s), &start);
            prop_assert!((warm - r).amax() < 2e-14, "{}", (warm - r).amax());
        }

        #[test]
        fn warm_start_finds_the_maximum_from_anywhere(f in matrix(), w in proptest::array::uniform3(-3.0..3.0f64)) {
            let start = Rotation3::from_scaled_axis(Vector3::from(w)).into_inner();
            let (warm, cold) = (polar_warm(&f, &start), polar_cold(&f));
            prop_assert!(is_rotation(&warm));
            let value = |r: &Matrix3<f64>| (r.transpose() * f).trace();
            prop_assert!((value(&warm) - value(&cold)).abs() < 1e-12);
        }
    }

    #[test]
    fn degenerate_gradients_stay_finite() {
        let flat = Matrix3::new(1.0, 0.2, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 0.0);
        let line = Matrix3::new(1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0);
        let cases =
            [Matrix3::zeros(), flat, line, -Matrix3::identity(), flat * 1e-300, flat * 1e300];
        for f in cases {
            for r in [polar_cold(&f), polar_warm(&f, &Matrix3::identity())] {
                assert!(is_rotation(&r), "{f} gave {r}");
            }
        }
        let broken = Matrix3::repeat(f64::NAN);
        assert_eq!(polar_warm(&broken, &Matrix3::identity()), Matrix3::identity());
    }
}
