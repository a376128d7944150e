//! The diagonal blocks of the factor, each with its own small LDLᵀ.

use crate::InverseError;

/// A pivot that is too small or has the wrong sign.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BadPivot {
    /// Position of the vertex in the elimination.
    pub position: usize,
    /// Row within the vertex.
    pub row: usize,
    pub value: f64,
    pub limit: f64,
}

impl BadPivot {
    /// As an error of the matrix `what`, whose row it is in `slot`.
    pub(crate) fn into_error(self, what: &'static str, slot: usize, block: usize) -> InverseError {
        let row = block * slot + self.row;
        InverseError::Singular { what, row, value: self.value, limit: self.limit }
    }
}

/// D = L Δ Lᵀ, L unit lower triangular, Δ diagonal: positive, negative in the last rows of a
/// quasi-definite matrix.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pivot<const M: usize> {
    /// L below its diagonal; on it, 1/Δ.
    pub lower: [[f64; M]; M],
}

impl<const M: usize> Pivot<M> {
    /// Factors a symmetric D, that of `position`. `floor` is the least |Δ| by row; a wrong sign
    /// fails as well.
    #[inline(always)]
    pub(crate) fn new(
        d: &[[f64; M]; M],
        floor: &[f64; M],
        negative: usize,
        position: usize,
    ) -> Result<Self, BadPivot> {
        let mut lower = *d;
        let mut delta = [0.0; M];
        for j in 0..M {
            let sign = if j + negative < M { 1.0 } else { -1.0 };
            let mut pivot = d[j][j];
            for k in 0..j {
                pivot -= lower[j][k] * lower[j][k] * delta[k];
            }
            // Not `pivot <= floor`: a NaN has to fail as well.
            if !(sign * pivot > floor[j] && pivot.is_finite()) {
                return Err(BadPivot { position, row: j, value: pivot, limit: floor[j] });
            }
            delta[j] = pivot;
            lower[j][j] = 1.0 / pivot;
            for i in j + 1..M {
                let mut value = d[i][j];
                for k in 0..j {
                    value -= lower[i][k] * lower[j][k] * delta[k];
                }
                lower[i][j] = value * lower[j][j];
            }
        }
        Ok(Self { lower })
    }

    /// x ← D⁻¹ x.
    #[inline(always)]
    pub(crate) fn solve(&self, x: &mut [f64; M]) {
        let mut column = x.map(|entry| [entry]);
        self.solve_all(&mut column);
        *x = column.map(|[entry]| entry);
    }

    /// The same of N at once, `x[i]` the entries i of all.
    #[inline(always)]
    pub(crate) fn solve_all<const N: usize>(&self, x: &mut [[f64; N]; M]) {
        for i in 0..M {
            for k in 0..i {
                (0..N).for_each(|n| x[i][n] -= self.lower[i][k] * x[k][n]);
            }
        }
        for i in 0..M {
            (0..N).for_each(|n| x[i][n] *= self.lower[i][i]);
        }
        for i in (0..M).rev() {
            for k in i + 1..M {
                (0..N).for_each(|n| x[i][n] -= self.lower[k][i] * x[k][n]);
            }
        }
    }

    /// L |Δ|^½, so that D = (L |Δ|^½) Σ (L |Δ|^½)ᵀ.
    pub(crate) fn half(&self) -> [[f64; M]; M] {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let size = 1.0 / self.lower[j][j].abs().sqrt();
                match i.cmp(&j) {
                    std::cmp::Ordering::Less => 0.0,
                    std::cmp::Ordering::Equal => size,
                    std::cmp::Ordering::Greater => self.lower[i][j] * size,
                }
            })
        })
    }

    pub(crate) fn read(flat: &[f64]) -> Self {
        Self { lower: square(flat) }
    }

    pub(crate) fn write(&self, flat: &mut [f64]) {
        flat.copy_from_slice(self.lower.as_flattened());
    }
}

/// A row-major block.
#[inline(always)]
pub(crate) fn square<const M: usize>(flat: &[f64]) -> [[f64; M]; M] {
    std::array::from_fn(|a| std::array::from_fn(|b| flat[M * a + b]))
}

/// Evaluates an expression, a kernel, in which `$M` is the constant 1, 2, 3 or 4 that `$rows` is.
macro_rules! by_rows {
    ($rows:expr, $M:ident => $kernel:expr) => {{
        macro_rules! with_rows {
            ($constant:literal) => {{
                const $M: usize = $constant;
                $kernel
            }};
        }
        match $rows {
            1 => with_rows!(1),
            2 => with_rows!(2),
            3 => with_rows!(3),
            _ => with_rows!(4),
        }
    }};
}

pub(crate) use by_rows;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definite_and_a_quasi_definite_block_by_hand() {
        // [4, 2; 2, 5] = [1, 0; ½, 1] diag(4, 4) [1, ½; 0, 1]
        let pivot = Pivot::new(&[[4.0, 2.0], [2.0, 5.0]], &[0.0; 2], 0, 0).unwrap();
        assert_eq!(pivot.lower[1], [0.5, 0.25]);
        let mut x = [8.0, 12.0];
        pivot.solve(&mut x);
        assert_eq!(x, [1.0, 2.0]);
        assert_eq!(pivot.half(), [[2.0, 0.0], [1.0, 2.0]]);
        // [4, 2; 2, −8]: second pivot −8 − 1
        let pivot = Pivot::new(&[[4.0, 2.0], [2.0, -8.0]], &[0.0; 2], 1, 0).unwrap();
        assert_eq!(pivot.lower[1], [0.5, -1.0 / 9.0]);
        assert_eq!(pivot.half(), [[2.0, 0.0], [1.0, 3.0]]);
    }

    #[test]
    fn wrong_signs_small_pivots_and_nan_fail() {
        let failed =
            |pivot: Result<Pivot<2>, BadPivot>| pivot.map_err(|bad| (bad.row, bad.value)).err();
        assert_eq!(failed(Pivot::new(&[[1.0, 2.0], [2.0, 1.0]], &[0.0; 2], 0, 0)), Some((1, -3.0)));
        assert_eq!(failed(Pivot::new(&[[1.0, 0.0], [0.0, 1.0]], &[0.0; 2], 1, 0)), Some((1, 1.0)));
        let small = Pivot::new(&[[1e-9]], &[1e-8], 0, 7).unwrap_err();
        assert_eq!((small.position, small.row, small.value, small.limit), (7, 0, 1e-9, 1e-8));
        assert!(Pivot::new(&[[f64::NAN]], &[0.0], 0, 0).is_err());
        assert!(Pivot::new(&[[f64::INFINITY]], &[0.0], 0, 0).is_err());
    }
}
