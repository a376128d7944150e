//! Symmetric 6×6 matrices, each entry once.

use nalgebra::Matrix6;

/// Entries of a symmetric 6×6 matrix.
const ENTRIES: usize = 21;

/// A symmetric 6×6 matrix as 21 numbers: the lower half row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packed6([f64; ENTRIES]);

impl Packed6 {
    /// Nothing but zeros.
    pub(crate) const ZERO: Self = Self([0.0; ENTRIES]);

    /// The lower half of `matrix`.
    pub fn new(matrix: &Matrix6<f64>) -> Self {
        let mut packed = [0.0; ENTRIES];
        for i in 0..6 {
            (0..=i).for_each(|j| packed[place(i, j)] = matrix[(i, j)]);
        }
        Self(packed)
    }

    /// The whole matrix.
    pub fn matrix(&self) -> Matrix6<f64> {
        Matrix6::from_fn(|i, j| self.0[place(i, j)])
    }
}

/// Where an entry is, and the one that mirrors it.
fn place(i: usize, j: usize) -> usize {
    let (i, j) = (i.max(j), i.min(j));
    i * (i + 1) / 2 + j
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_comes_back() {
        let matrix = Matrix6::from_fn(|i, j| {
            (10 * i.max(j) + i.min(j)) as f64 * if i == j { 7.0 } else { 1.0 }
        });
        assert_eq!(Packed6::new(&matrix).matrix(), matrix);
    }
}
