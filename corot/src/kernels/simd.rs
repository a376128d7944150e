//! Vectors, matrices and rotations of several elements at once, one per vector lane.
//!
//! Loops and functions that are always inlined, no iterators and no closures handed on: a function
//! that is compiled by itself knows nothing of the vector unit that its caller was chosen for.

use std::ops::{Add, Mul, Neg, Sub};

use nalgebra::Matrix3;
use pulp::Simd;

/// Elements that share a packet: one 512-bit vector, or several narrower ones.
pub(crate) const LANES: usize = 8;

/// One number of each element of a packet.
pub(crate) type Row = [f64; LANES];

/// One matrix of each element of a packet, row-major.
pub(crate) type Rows = [[Row; 3]; 3];

/// As many lanes as the vector unit has.
#[derive(Clone, Copy)]
pub(crate) struct V<S: Simd>(pub S, pub S::f64s);

pub(crate) type V3<S> = [V<S>; 3];
/// Row-major.
pub(crate) type M3<S> = [[V<S>; 3]; 3];

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

    /// The larger of both.
    #[inline(always)]
    pub fn or_more(self, other: Self) -> Self {
        Self(self.0, self.0.max_f64s(self.1, other.1))
    }

    /// The smaller of both.
    #[inline(always)]
    pub fn or_less(self, other: Self) -> Self {
        Self(self.0, self.0.min_f64s(self.1, other.1))
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

/// A B.
#[inline(always)]
pub(crate) fn product<S: Simd>(a: &M3<S>, b: &M3<S>) -> M3<S> {
    let mut c = *a;
    for i in 0..3 {
        for j in 0..3 {
            c[i][j] = (a[i][0] * b[0][j]).plus(a[i][1], b[1][j]).plus(a[i][2], b[2][j]);
        }
    }
    c
}

/// Aᵀ B.
#[inline(always)]
pub(crate) fn transposed_product<S: Simd>(a: &M3<S>, b: &M3<S>) -> M3<S> {
    let mut c = *a;
    for i in 0..3 {
        for j in 0..3 {
            c[i][j] = (a[0][i] * b[0][j]).plus(a[1][i], b[1][j]).plus(a[2][i], b[2][j]);
        }
    }
    c
}

/// Three rows of a packet's matrix or the like.
#[inline(always)]
pub(crate) fn load3<S: Simd>(simd: S, rows: &[Row; 3], part: usize) -> V3<S> {
    [V::load(simd, &rows[0], part), V::load(simd, &rows[1], part), V::load(simd, &rows[2], part)]
}

#[inline(always)]
pub(crate) fn load33<S: Simd>(simd: S, rows: &Rows, part: usize) -> M3<S> {
    [load3(simd, &rows[0], part), load3(simd, &rows[1], part), load3(simd, &rows[2], part)]
}

#[inline(always)]
pub(crate) fn store33<S: Simd>(matrix: &M3<S>, rows: &mut Rows, part: usize) {
    for i in 0..3 {
        for j in 0..3 {
            matrix[i][j].store(&mut rows[i][j], part);
        }
    }
}

#[inline(always)]
pub(crate) fn matrix(rows: &Rows, lane: usize) -> Matrix3<f64> {
    let [x, y, z] = rows;
    Matrix3::new(
        x[0][lane], x[1][lane], x[2][lane], y[0][lane], y[1][lane], y[2][lane], z[0][lane],
        z[1][lane], z[2][lane],
    )
}

#[inline(always)]
pub(crate) fn set_matrix(rows: &mut Rows, lane: usize, matrix: &Matrix3<f64>) {
    for i in 0..3 {
        for j in 0..3 {
            rows[i][j][lane] = matrix[(i, j)];
        }
    }
}
