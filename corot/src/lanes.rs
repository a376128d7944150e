//! Vectors, matrices and rotations of several elements at once, one per vector lane.

use std::ops::{Add, Mul, Neg, Sub};

use pulp::Simd;

/// Elements that share a packet: one 512-bit vector, or several narrower ones.
pub(crate) const LANES: usize = 8;

/// One number of each element of a packet.
pub(crate) type Row = [f64; LANES];

/// As many lanes as the vector unit has.
pub(crate) struct V<S: Simd>(pub S, pub S::f64s);

pub(crate) type V3<S> = [V<S>; 3];
/// Row-major.
pub(crate) type M3<S> = [[V<S>; 3]; 3];

impl<S: Simd> Clone for V<S> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Simd> Copy for V<S> {}

impl<S: Simd> Add for V<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0, self.0.add_f64s(self.1, other.1))
    }
}

impl<S: Simd> Sub for V<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0, self.0.sub_f64s(self.1, other.1))
    }
}

impl<S: Simd> Mul for V<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0, self.0.mul_f64s(self.1, other.1))
    }
}

impl<S: Simd> Neg for V<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0, self.0.neg_f64s(self.1))
    }
}

impl<S: Simd> V<S> {
    /// The same number in all lanes.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self(simd, simd.splat_f64s(value))
    }

    /// Part `part` of a row, as wide as the vector unit.
    #[inline(always)]
    pub fn load(simd: S, row: &Row, part: usize) -> Self {
        Self(simd, S::as_simd_f64s(row).0[part])
    }

    #[inline(always)]
    pub fn store(self, row: &mut Row, part: usize) {
        S::as_mut_simd_f64s(row).0[part] = self.1;
    }

    /// a b + self.
    #[inline(always)]
    pub fn plus(self, a: Self, b: Self) -> Self {
        Self(self.0, self.0.mul_add_f64s(a.1, b.1, self.1))
    }

    #[inline(always)]
    pub fn over(self, other: Self) -> Self {
        Self(self.0, self.0.div_f64s(self.1, other.1))
    }

    /// NaN lanes are lost here: what must show them is added up, not compared.
    #[inline(always)]
    pub fn largest(self) -> f64 {
        self.0.reduce_max_f64s(self.1)
    }
}

#[inline(always)]
pub(crate) fn dot<S: Simd>(a: &V3<S>, b: &V3<S>) -> V<S> {
    (a[0] * b[0]).plus(a[1], b[1]).plus(a[2], b[2])
}

#[inline(always)]
pub(crate) fn column<S: Simd>(a: &M3<S>, j: usize) -> V3<S> {
    [a[0][j], a[1][j], a[2][j]]
}

/// A B.
#[inline(always)]
pub(crate) fn product<S: Simd>(a: &M3<S>, b: &M3<S>) -> M3<S> {
    let columns = [column(b, 0), column(b, 1), column(b, 2)];
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| dot(&a[i], &columns[j])))
}

/// Aᵀ B.
#[inline(always)]
pub(crate) fn transposed_product<S: Simd>(a: &M3<S>, b: &M3<S>) -> M3<S> {
    let (left, right) = ([0, 1, 2].map(|i| column(a, i)), [0, 1, 2].map(|j| column(b, j)));
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| dot(&left[i], &right[j])))
}

/// Three rows of a packet's matrix or the like.
#[inline(always)]
pub(crate) fn load3<S: Simd>(simd: S, rows: &[Row; 3], part: usize) -> V3<S> {
    [0, 1, 2].map(|i| V::load(simd, &rows[i], part))
}

#[inline(always)]
pub(crate) fn load33<S: Simd>(simd: S, rows: &[[Row; 3]; 3], part: usize) -> M3<S> {
    [0, 1, 2].map(|i| load3(simd, &rows[i], part))
}

#[inline(always)]
pub(crate) fn store33<S: Simd>(matrix: &M3<S>, rows: &mut [[Row; 3]; 3], part: usize) {
    for i in 0..3 {
        for j in 0..3 {
            matrix[i][j].store(&mut rows[i][j], part);
        }
    }
}
