//! The scalar in which a dense inverse is stored, and its vector arithmetic.

use pulp::Simd;

/// The precision in which C is stored: f64, or f32 where every solution is refined in f64.
///
/// Sealed: the limits of the algorithms and the kernels are made for these two.
pub trait Precision:
    Copy + Default + PartialEq + std::ops::Add<Output = Self> + Send + Sync + 'static + sealed::Sealed
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
    type Vector<S: Simd>: Copy;

    /// Rounds.
    fn of(value: f64) -> Self;
    /// Exact.
    fn value(self) -> f64;
    /// A slice as whole vectors; what does not fill one is left off.
    fn vectors<S: Simd>(slice: &[Self]) -> &[Self::Vector<S>];
    /// As [`vectors`](Self::vectors), to be written to.
    fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [Self::Vector<S>];
    /// The same value in every place of a vector.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;
    /// a b + c.
    fn mul_add<S: Simd>(
        simd: S,
        a: Self::Vector<S>,
        b: Self::Vector<S>,
        c: Self::Vector<S>,
    ) -> Self::Vector<S>;
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f64 {}
    impl Sealed for f32 {}
}

impl Precision for f64 {
    const METHOD: &'static str = "woodbury";
    const EPSILON: f64 = f64::EPSILON;
    const PIVOT_FLOOR: f64 = crate::change::PIVOT_FLOOR;
    // Softening by h = 1/pivot multiplies the relative error that stiff modes have in C, ε h, by
    // h once more: beyond 100 that adds up.
    const SOFTENING: f64 = 1e-2;
    const DRIFT_LIMIT: f64 = crate::DRIFT_LIMIT;
    const REFINED: bool = false;

    type Vector<S: Simd> = S::f64s;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn vectors<S: Simd>(slice: &[Self]) -> &[S::f64s] {
        S::as_simd_f64s(slice).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::f64s] {
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

impl Precision for f32 {
    const METHOD: &'static str = "woodbury_f32";
    const EPSILON: f64 = f32::EPSILON as f64;
    // √ε of f32.
    const PIVOT_FLOOR: f64 = 3.5e-4;
    // Errors of G of size ε κ show sooner than in f64.
    const SOFTENING: f64 = 0.1;
    const DRIFT_LIMIT: f64 = crate::DRIFT_LIMIT_F32;
    const REFINED: bool = true;

    type Vector<S: Simd> = S::f32s;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn vectors<S: Simd>(slice: &[Self]) -> &[S::f32s] {
        S::as_simd_f32s(slice).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::f32s] {
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
