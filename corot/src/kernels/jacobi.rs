//! Eigenvalues and eigenvectors of small symmetric matrices, eight at once.

use nalgebra::{SMatrix, SVector};
use pulp::{Simd, WithSimd};

use super::simd::{LANES, Row};

/// Sweeps at most; quadratic convergence takes six or seven.
const SWEEPS: usize = 30;

/// N × N matrices, one per vector lane, and what turns each into its diagonal.
struct Turned<const N: usize> {
    matrix: [[Row; N]; N],
    vectors: [[Row; N]; N],
}

/// The eigenvalues, in no order, and eigenvectors, by columns, of up to eight symmetric matrices.
///
/// Cost: about as much for eight as for one. Source: cyclic Jacobi; Golub, Van Loan, Matrix computations, 8.5.
///
/// # Panics
/// If there are more than eight.
pub(crate) fn eigen<const N: usize>(
    matrices: &[SMatrix<f64, N, N>],
) -> Vec<(SVector<f64, N>, SMatrix<f64, N, N>)> {
    assert!(matrices.len() <= LANES, "{} matrices for {LANES} lanes", matrices.len());
    let entry = |i: usize, j: usize| {
        std::array::from_fn(|lane| matrices.get(lane).map_or(0.0, |matrix| matrix[(i, j)]))
    };
    let one = |i: usize, j: usize| [if i == j { 1.0 } else { 0.0 }; LANES];
    let square = |of: &dyn Fn(usize, usize) -> Row| {
        std::array::from_fn(|i| std::array::from_fn(|j| of(i, j)))
    };
    let mut turned = Turned::<N> { matrix: square(&entry), vectors: square(&one) };
    pulp::Arch::new().dispatch(&mut turned);
    let of_lane = |lane: usize| {
        let values = SVector::from_fn(|i, _| turned.matrix[i][i][lane]);
        (values, SMatrix::from_fn(|i, j| turned.vectors[i][j][lane]))
    };
    (0..matrices.len()).map(of_lane).collect()
}

impl<const N: usize> WithSimd for &mut Turned<N> {
    type Output = ();

    /// Plain loops over lanes, which the compiler brings to the vector unit.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for _ in 0..SWEEPS {
            if self.is_diagonal() {
                return;
            }
            for p in 0..N {
                for q in p + 1..N {
                    self.turn(p, q);
                }
            }
        }
    }
}

impl<const N: usize> Turned<N> {
    /// Whether what is beside the diagonal is rounding in all lanes.
    #[inline(always)]
    fn is_diagonal(&self) -> bool {
        let (mut beside, mut all) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..N {
            for j in 0..N {
                for lane in 0..LANES {
                    let square = self.matrix[i][j][lane] * self.matrix[i][j][lane];
                    all[lane] += square;
                    beside[lane] += if i == j { 0.0 } else { square };
                }
            }
        }
        // Never so for what is no number, which spreads.
        (0..LANES).all(|lane| beside[lane] <= f64::EPSILON * f64::EPSILON * all[lane])
    }

    /// Turns the plane of two axes so that their entry becomes 0.
    #[inline(always)]
    fn turn(&mut self, p: usize, q: usize) {
        let (mut cosine, mut sine, mut slope) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let between = 2.0 * self.matrix[p][q][lane];
            let apart = self.matrix[q][q][lane] - self.matrix[p][p][lane];
            let root = (apart * apart + between * between).sqrt();
            let sum = apart + root.copysign(apart);
            slope[lane] = if sum == 0.0 { 0.0 } else { between / sum };
            cosine[lane] = 1.0 / (1.0 + slope[lane] * slope[lane]).sqrt();
            sine[lane] = slope[lane] * cosine[lane];
        }
        for lane in 0..LANES {
            let change = slope[lane] * self.matrix[p][q][lane];
            self.matrix[p][p][lane] -= change;
            self.matrix[q][q][lane] += change;
            self.matrix[p][q][lane] = 0.0;
            self.matrix[q][p][lane] = 0.0;
        }
        for k in 0..N {
            if k != p && k != q {
                for lane in 0..LANES {
                    let (x, y) = (self.matrix[k][p][lane], self.matrix[k][q][lane]);
                    let (x, y) =
                        (cosine[lane] * x - sine[lane] * y, sine[lane] * x + cosine[lane] * y);
                    self.matrix[k][p][lane] = x;
                    self.matrix[p][k][lane] = x;
                    self.matrix[k][q][lane] = y;
                    self.matrix[q][k][lane] = y;
                }
            }
            for lane in 0..LANES {
                let (x, y) = (self.vectors[k][p][lane], self.vectors[k][q][lane]);
                self.vectors[k][p][lane] = cosine[lane] * x - sine[lane] * y;
                self.vectors[k][q][lane] = sine[lane] * x + cosine[lane] * y;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A matrix with eigenvalues from 1 down to 10⁻¹², some of them equal, some negative, some zero.
    fn symmetric(entries: &[f64]) -> SMatrix<f64, 9, 9> {
        let q = SMatrix::<f64, 9, 9>::from_fn(|i, j| entries[9 * i + j]).qr().q();
        let values = [1.0, 1.0, -0.5, 0.0, 1e-3, -1e-6, 1e-12, -1.0, entries[0]];
        q * SMatrix::from_diagonal(&values.into()) * q.transpose()
    }

    proptest! {
        #[test]
        fn vectors_times_values_make_the_matrix(
            entries in proptest::collection::vec(-1.0..1.0f64, 81),
            count in 1..=LANES,
        ) {
            let matrices: Vec<_> = (0..count)
                .map(|k| symmetric(&entries) * 10f64.powi(20 - 5 * k as i32))
                .map(|matrix| (matrix + matrix.transpose()) * 0.5)
                .collect();
            let found = eigen(&matrices);
            prop_assert_eq!(found.len(), count);
            for (matrix, (values, vectors)) in matrices.iter().zip(&found) {
                let made = vectors * SMatrix::from_diagonal(values) * vectors.transpose();
                prop_assert!((made - matrix).amax() < 1e-14 * matrix.amax());
                let unit = vectors.tr_mul(vectors) - SMatrix::identity();
                prop_assert!(unit.amax() < 1e-14);
            }
        }
    }

    #[test]
    fn diagonal_and_empty_matrices_stay_and_what_is_no_number_ends() {
        let diagonal = SMatrix::<f64, 3, 3>::from_diagonal(&[3.0, -1.0, 0.0].into());
        let mut broken = diagonal;
        broken[(0, 1)] = f64::NAN;
        broken[(1, 0)] = f64::NAN;
        let found = eigen(&[diagonal, SMatrix::zeros(), broken]);
        assert_eq!(found[0], ([3.0, -1.0, 0.0].into(), SMatrix::identity()));
        assert_eq!(found[1], (SVector::zeros(), SMatrix::identity()));
        assert!(found[2].0.iter().any(|value| !value.is_finite()));
    }
}
