//! The warm-started polar decomposition of [`rotation`](crate::rotation), several at once.

use pulp::Simd;

use super::simd::{
    LANES, M3, Row, Rows, V, V3, dot, load33, matrix, product, set_matrix, store33,
    transposed_product,
};
use crate::element::rotation::polar_warm;

/// Steps before a lane is left to the scalar code.
const STEPS: usize = 4;

/// Squared length of a step, rad², that ends the iteration: what it leaves is below rounding.
const DONE: f64 = 1e-16;

/// det(H) must exceed this part of (tr(H)/2)³, which keeps its least eigenvalue positive and well
/// away from 0; else a lane is left to the scalar code.
const DEFINITE: f64 = 1e-3;

/// Renews rotations: each becomes the one nearest to that of `gradients`. Lanes in doubt are done
/// over by the scalar code.
#[inline(always)]
pub(super) fn renew_rotations<S: Simd>(simd: S, gradients: &Rows, rotations: &mut Rows) {
    let (start, mut verdict) = (*rotations, [0.0; LANES]);
    for part in 0..LANES / S::F64_LANES {
        let f = load33(simd, gradients, part);
        let (r, in_doubt) = polar(simd, &f, &load33(simd, &start, part));
        store33(&r, rotations, part);
        in_doubt.store(&mut verdict, part);
    }
    if !verdict.iter().all(|&verdict| verdict < 1.0) {
        renew_in_doubt(gradients, &start, &verdict, rotations);
    }
}

#[cold]
#[inline(never)]
fn renew_in_doubt(gradients: &Rows, start: &Rows, verdict: &Row, rotations: &mut Rows) {
    for lane in (0..LANES).filter(|&lane| !(verdict[lane] < 1.0)) {
        let r = polar_warm(&matrix(gradients, lane), &matrix(start, lane));
        set_matrix(rotations, lane, &r);
    }
}

/// The rotations nearest to `f`, from `start`, and a figure per lane that is below 1 where the
/// iteration ended well; anywhere else (NaN included) the lane means nothing.
///
/// The step is that of the scalar code, applied by Cayley's map, which differs from the exponential
/// in third order and needs no sine: R ← R (I + 2(A + A²)/(1+|a|²)), a = ω/2, A = a×. With
/// H = tr(S)I − S positive definite the end is the one maximum of tr(RᵀF).
#[inline(always)]
fn polar<S: Simd>(simd: S, f: &M3<S>, start: &M3<S>) -> (M3<S>, V<S>) {
    let mut r = *start;
    let mut verdict = V::splat(simd, f64::INFINITY);
    for _ in 0..STEPS {
        let (omega, definite) = newton_step(simd, f, &r);
        let squared = dot(&omega, &omega);
        turn(simd, &mut r, &omega, squared);
        // 0 where H is definite, infinity or NaN where it is not.
        verdict = definite.plus(squared, V::splat(simd, 0.5 / DONE));
        if verdict.largest() < 1.0 {
            break;
        }
    }
    (renormalised(simd, &r), verdict)
}

/// ω = (tr(S)I − S)⁻¹ skew(RᵀF) by cofactors; and 0 where that matrix is definite, ∞ elsewhere.
#[inline(always)]
fn newton_step<S: Simd>(simd: S, f: &M3<S>, r: &M3<S>) -> (V3<S>, V<S>) {
    let m = transposed_product(r, f);
    let skew = axial(&m);
    let (cofactors, determinant, trace) = turning(simd, &m);
    let inverse = V::splat(simd, 1.0).over(determinant);
    let [x, y, z] = cofactors;
    let omega = [dot(&x, &skew) * inverse, dot(&y, &skew) * inverse, dot(&z, &skew) * inverse];
    // Definite iff the minors h₀, h₀h₁ − xy² and the determinant are positive.
    let bar = V::splat(simd, DEFINITE) * trace * trace * trace;
    let definite = infinite_unless_positive(simd, m[1][1] + m[2][2])
        + infinite_unless_positive(simd, z[2])
        + infinite_unless_positive(simd, determinant)
        // With a negative trace this alone would pass half a turn away from the maximum.
        + infinite_unless_positive(simd, determinant - bar);
    (omega, definite)
}

/// The axial vector of M − Mᵀ.
#[inline(always)]
pub(super) fn axial<S: Simd>(m: &M3<S>) -> V3<S> {
    [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
}

/// Cofactors and determinant of tr(S)I − S, S the symmetric part of M, and its trace.
#[inline(always)]
pub(super) fn turning<S: Simd>(simd: S, m: &M3<S>) -> (M3<S>, V<S>, V<S>) {
    let half = V::splat(simd, -0.5);
    let h = [m[1][1] + m[2][2], m[0][0] + m[2][2], m[0][0] + m[1][1]];
    let xy = (m[0][1] + m[1][0]) * half;
    let yz = (m[1][2] + m[2][1]) * half;
    let zx = (m[2][0] + m[0][2]) * half;
    let c00 = h[1] * h[2] - yz * yz;
    let c11 = h[0] * h[2] - zx * zx;
    let c22 = h[0] * h[1] - xy * xy;
    let c01 = zx * yz - xy * h[2];
    let c02 = xy * yz - zx * h[1];
    let c12 = xy * zx - h[0] * yz;
    let determinant = (h[0] * c00).plus(xy, c01).plus(zx, c02);
    let trace = h[0] + m[0][0];
    ([[c00, c01, c02], [c01, c11, c12], [c02, c12, c22]], determinant, trace)
}

/// 0 where the value is positive, ∞ elsewhere.
#[inline(always)]
fn infinite_unless_positive<S: Simd>(simd: S, value: V<S>) -> V<S> {
    let zero = simd.splat_f64s(0.0);
    let positive = simd.greater_than_f64s(value.1, zero);
    V(simd, simd.select_f64s(positive, zero, simd.splat_f64s(f64::INFINITY)))
}

/// R ← R cay(ω).
#[inline(always)]
fn turn<S: Simd>(simd: S, r: &mut M3<S>, omega: &V3<S>, squared: V<S>) {
    let one = V::splat(simd, 1.0);
    let half = V::splat(simd, 0.5);
    let [x, y, z] = [omega[0] * half, omega[1] * half, omega[2] * half];
    // 2/(1 + |a|²)
    let scale = V::splat(simd, 2.0).over(one.plus(squared, V::splat(simd, 0.25)));
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let map = [
        [one - scale * (yy + zz), scale * (x * y - z), scale * (x * z + y)],
        [scale * (x * y + z), one - scale * (zz + xx), scale * (y * z - x)],
        [scale * (x * z - y), scale * (y * z + x), one - scale * (xx + yy)],
    ];
    *r = product(r, &map);
}

/// R(3I − RᵀR)/2.
#[inline(always)]
fn renormalised<S: Simd>(simd: S, r: &M3<S>) -> M3<S> {
    let mut correction = transposed_product(r, r);
    for i in 0..3 {
        for j in 0..3 {
            correction[i][j] = correction[i][j] * V::splat(simd, -0.5);
        }
        correction[i][i] = correction[i][i] + V::splat(simd, 1.5);
    }
    product(r, &correction)
}
