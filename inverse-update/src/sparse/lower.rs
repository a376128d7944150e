//! L of a panel, and the copies of it that substitution reads.

use std::ops::{Deref, DerefMut};
use std::sync::OnceLock;

use pulp::Simd;

/// Scalar rows that kernels handle at once on any vector unit, so that sums don't depend on it.
pub(crate) const CHUNK: usize = 8;

/// L of a panel. Whoever may change it makes the copies for reading forgotten; a clone has none.
#[derive(Debug, Default)]
pub(crate) struct Lower {
    values: Vec<f64>,
    packed: OnceLock<Packed<f64>>,
    rounded: OnceLock<Packed<f32>>,
}

impl From<Vec<f64>> for Lower {
    fn from(values: Vec<f64>) -> Self {
        Self { values, ..Self::default() }
    }
}

impl Clone for Lower {
    fn clone(&self) -> Self {
        self.values.clone().into()
    }
}

impl Deref for Lower {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.values
    }
}

impl DerefMut for Lower {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        self.forget();
        &mut self.values
    }
}

impl Lower {
    /// Called where the panel has other rows than before.
    #[inline(always)]
    pub(crate) fn forget(&mut self) {
        self.packed.take();
        self.rounded.take();
    }
}

/// The numbers that a copy of L is made of.
pub(super) trait Digits: Copy + Default + 'static {
    /// Rows of a column, aligned as vector units like it.
    type Rows: Copy;

    /// Rounds.
    fn rows(values: [f64; CHUNK]) -> Self::Rows;

    /// The vector of this number of them.
    fn load<S: Simd>(simd: S, rows: &Self::Rows, part: usize) -> S::f64s;

    fn copy_in(lower: &Lower) -> &OnceLock<Packed<Self>>;
}

/// Rows in f64.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Whole([f64; CHUNK]);

/// Rows in f32.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Rounded([f32; CHUNK]);

impl Digits for f64 {
    type Rows = Whole;

    fn rows(values: [f64; CHUNK]) -> Whole {
        Whole(values)
    }

    #[inline(always)]
    fn load<S: Simd>(_: S, rows: &Whole, part: usize) -> S::f64s {
        S::as_simd_f64s(&rows.0).0[part]
    }

    fn copy_in(lower: &Lower) -> &OnceLock<Packed<f64>> {
        &lower.packed
    }
}

impl Digits for f32 {
    type Rows = Rounded;

    fn rows(values: [f64; CHUNK]) -> Rounded {
        Rounded(values.map(|value| value as f32))
    }

    #[inline(always)]
    fn load<S: Simd>(_: S, rows: &Rounded, part: usize) -> S::f64s {
        S::as_simd_f64s(&Whole(rows.0.map(f64::from)).0).0[part]
    }

    fn copy_in(lower: &Lower) -> &OnceLock<Packed<f32>> {
        &lower.rounded
    }
}

#[derive(Debug, Clone)]
pub(super) struct Packed<T: Digits> {
    /// The triangles of all strips: as many rows as columns, column by column.
    pub triangles: Vec<f64>,
    /// What is below them.
    pub below: Vec<T::Rows>,
}
