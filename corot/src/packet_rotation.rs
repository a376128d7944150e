//! The warm-started polar decomposition of [`rotation`](crate::rotation), several at once.

use pulp::Simd;

use crate::lanes::{M3, V, dot, product, transposed_product};

/// Steps before a lane is left to the scalar code.
const STEPS: usize = 4;

/// Squared length of a step, rad², that ends the iteration: what it leaves is below rounding.
const DONE: f64 = 1e-16;

/// det(H) must exceed this part of (tr(H)/2)³, which keeps its least eigenvalue positive and well
/// away from 0; else a lane is left to the scalar code.
const DEFINITE: f64 = 1e-3;

/// The rotations nearest to `f`, from `start`, and a figure per lane that is below 1 where the
/// iteration ended well; anywhere else (NaN included) the lane means nothing.
///
/// The step is that of the scalar code, applied by Cayley's map, which differs from the exponential
/// in third order and needs no sine: R ← R (I + 2(A + A²)/(1+|a|²)), a = ω/2, A = [a]. With
/// H = tr(S)I − S positive definite the end is the one maximum of tr(RᵀF).
#[inline(always)]
pub(crate) fn polar<S: Simd>(simd: S, f: &M3<S>, start: &M3<S>) -> (M3<S>, V<S>) {
    let mut r = *start;
    let constant = |value| V::splat(simd, value);
    let mut verdict = constant(f64::INFINITY);
    for _ in 0..STEPS {
        let (omega, definite) = newton_step(simd, f, &r);
        let squared = dot(&omega, &omega);
        turn(simd, &mut r, &omega, squared);
        // 0 where H is definite, infinity or NaN where it is not.
        verdict = (squared * constant(0.5 / DONE)) + definite;
        if verdict.largest() < 1.0 {
            break;
        }
    }
    (renormalised(simd, &r), verdict)
}

/// ω = (tr(S)I − S)⁻¹ skew(RᵀF) by cofactors; and 0 where that matrix is definite, ∞ elsewhere.
#[inline(always)]
fn newton_step<S: Simd>(simd: S, f: &M3<S>, r: &M3<S>) -> ([V<S>; 3], V<S>) {
    let constant = |value| V::splat(simd, value);
    let m = transposed_product(r, f);
    let skew = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    let half = constant(-0.5);
    let h = [m[1][1] + m[2][2], m[0][0] + m[2][2], m[0][0] + m[1][1]];
    let [xy, yz, zx] =
        [(m[0][1] + m[1][0]) * half, (m[1][2] + m[2][1]) * half, (m[2][0] + m[0][2]) * half];
    let cofactors = [
        [h[1] * h[2] - yz * yz, zx * yz - xy * h[2], xy * yz - zx * h[1]],
        [zx * yz - xy * h[2], h[0] * h[2] - zx * zx, xy * zx - h[0] * yz],
        [xy * yz - zx * h[1], xy * zx - h[0] * yz, h[0] * h[1] - xy * xy],
    ];
    let determinant = dot(&[h[0], xy, zx], &[cofactors[0][0], cofactors[1][0], cofactors[2][0]]);
    let inverse = constant(1.0).over(determinant);
    let omega = [0, 1, 2].map(|i| dot(&cofactors[i], &skew) * inverse);
    // Definite iff the minors h₀, h₀h₁ − xy² and the determinant are positive.
    let half_trace = (h[0] + h[1] + h[2]) * constant(0.5);
    let bar = constant(DEFINITE) * half_trace * half_trace * half_trace;
    let simd_infinite = |value: V<S>| {
        let positive = simd.greater_than_f64s(value.1, constant(0.0).1);
        V(simd, simd.select_f64s(positive, constant(0.0).1, constant(f64::INFINITY).1))
    };
    let definite =
        simd_infinite(h[0]) + simd_infinite(cofactors[2][2]) + simd_infinite(determinant - bar);
    (omega, definite)
}

/// R ← R cay(ω).
#[inline(always)]
fn turn<S: Simd>(simd: S, r: &mut M3<S>, omega: &[V<S>; 3], squared: V<S>) {
    let constant = |value| V::splat(simd, value);
    let a = omega.map(|w| w * constant(0.5));
    let scale = constant(2.0).over(constant(1.0) + squared * constant(0.25));
    let zero = constant(0.0);
    let cross = [[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]];
    let square = product(&cross, &cross);
    let mut map = [0, 1, 2].map(|i| [0, 1, 2].map(|j| (cross[i][j] + square[i][j]) * scale));
    (0..3).for_each(|i| map[i][i] = map[i][i] + constant(1.0));
    *r = product(r, &map);
}

/// R(3I − RᵀR)/2.
#[inline(always)]
fn renormalised<S: Simd>(simd: S, r: &M3<S>) -> M3<S> {
    let constant = |value| V::splat(simd, value);
    let mut correction = transposed_product(r, r).map(|row| row.map(|v| v * constant(-0.5)));
    (0..3).for_each(|i| correction[i][i] = correction[i][i] + constant(1.5));
    product(r, &correction)
}
