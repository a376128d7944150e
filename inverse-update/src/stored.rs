//! The scalar in which a dense inverse is stored, and its vector arithmetic.

use pulp::Simd;

/// A stored scalar: f64, or f32 where every solution is refined in f64.
pub trait Stored:
    Copy + Default + PartialEq + std::ops::Add<Output = Self> + Send + Sync + 'static
{
    /// Scene name of the dense maintainer that stores this scalar.
    const METHOD: &'static str;
    /// Spacing of the numbers at 1.
    const EPSILON: f64;
    /// Pivot of I − NᵀCN, below which an update has lost half of the stored digits.
    const PIVOT_FLOOR: f64;
    /// Pivot of I − NᵀCN, below which the update is refined against K.
    const SOFTENING: f64;
    /// Drift above which a rebuild is due.
    const DRIFT_LIMIT: f64;
    /// Whether solutions and columns are refined against K to more than the scalar holds.
    const REFINED: bool;

    /// As many of these as the vector unit takes at once.
    type Lanes<S: Simd>: Copy;

    /// Rounds.
    fn of(value: f64) -> Self;
    /// Exact.
    fn value(self) -> f64;
    /// A slice as whole vectors; what does not fill one is left off.
    fn lanes<S: Simd>(slice: &[Self]) -> &[Self::Lanes<S>];
    /// As [`lanes`](Self::lanes), to be written to.
    fn lanes_mut<S: Simd>(slice: &mut [Self]) -> &mut [Self::Lanes<S>];
    /// The same value in every lane.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Lanes<S>;
    /// a b + c.
    fn mul_add<S: Simd>(
        simd: S,
        a: Self::Lanes<S>,
        b: Self::Lanes<S>,
        c: Self::Lanes<S>,
    ) -> Self::Lanes<S>;
}

impl Stored for f64 {
    const METHOD: &'static str = "woodbury";
    const EPSILON: f64 = f64::EPSILON;
    const PIVOT_FLOOR: f64 = crate::capacitance::PIVOT_FLOOR;
    // Softening by h = 1/pivot multiplies the relative error that stiff modes have in C, ε h, by
    // h once more: beyond 100 that adds up.
    const SOFTENING: f64 = 1e-2;
    const DRIFT_LIMIT: f64 = crate::DRIFT_LIMIT;
    const REFINED: bool = false;

    type Lanes<S: Simd> = S::f64s;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn lanes<S: Simd>(slice: &[Self]) -> &[S::f64s] {
        S::as_simd_f64s(slice).0
    }
    #[inline(always)]
    fn lanes_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::f64s] {
        S::as_mut_simd_f64s(slice).0
    }
    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f64s {
        simd.splat_f64s(value)
    }
    #[inline(always)]
    fn mul_add<S: Simd>(simd: S, a: S::f64s, b: S::f64s, c: S::f64s) -> S::f64s {
        simd.mul_add_e_f64s(a, b, c)
    }
}

impl Stored for f32 {
    const METHOD: &'static str = "woodbury_f32";
    const EPSILON: f64 = f32::EPSILON as f64;
    // √ε of f32.
    const PIVOT_FLOOR: f64 = 3.5e-4;
    // Errors of G of size ε κ show sooner than in f64.
    const SOFTENING: f64 = 0.1;
    const DRIFT_LIMIT: f64 = crate::DRIFT_LIMIT_F32;
    const REFINED: bool = true;

    type Lanes<S: Simd> = S::f32s;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn lanes<S: Simd>(slice: &[Self]) -> &[S::f32s] {
        S::as_simd_f32s(slice).0
    }
    #[inline(always)]
    fn lanes_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::f32s] {
        S::as_mut_simd_f32s(slice).0
    }
    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f32s {
        simd.splat_f32s(value)
    }
    #[inline(always)]
    fn mul_add<S: Simd>(simd: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
        simd.mul_add_e_f32s(a, b, c)
    }
}
