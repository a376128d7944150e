//! Symmetric changes of low rank, in factors.

use faer::{Mat, MatRef};

/// Columns of several matrices, on the same rows.
pub(crate) fn beside(parts: &[MatRef<'_, f64>]) -> Mat<f64> {
    let rows = parts.first().map_or(0, |part| part.nrows());
    let mut whole = Mat::zeros(rows, parts.iter().map(|part| part.ncols()).sum());
    let mut first = 0;
    for part in parts {
        whole.subcols_mut(first, part.ncols()).copy_from(part);
        first += part.ncols();
    }
    whole
}

/// Entries below this part of the squared length of a row of U are what rounding leaves where they cancel.
const NOISE: f64 = 16.0 * f64::EPSILON;

/// A diagonal entry above this part of the largest one of all is a pivot by itself: (1 + √17)/8, with which entries
/// grow least.
const ALONE: f64 = 0.640_388_203_202_208_4;

/// U Σ Uᵀ = Σ_j ± w_j w_jᵀ, Σ = diag(`signs`), with as few columns w_j as it takes, and their signs: by pivots of one
/// or two rows, the largest first. Rows of U are brought to equal size before, so that small ones keep their digits;
/// when all entries that are left are rounding they are left out.
///
/// Cost: O(r² (k + j)) for r rows, k columns and j columns found; O(r k²) where r is more than k.
/// # Errors
/// The largest length of a row of U where that is not finite.
/// # Source
/// Bunch, Parlett, Direct methods for solving symmetric indefinite systems of linear equations, SIAM J. Numer. Anal. 8,
/// 1971.
pub(crate) fn pivoted(u: MatRef<'_, f64>, signs: &[f64]) -> Result<(Mat<f64>, Vec<f64>), f64> {
    let size = |i: usize| match u.row(i).norm_l2() {
        norm if norm > 0.0 => norm,
        _ => 1.0,
    };
    let scale: Vec<f64> = (0..u.nrows()).map(size).collect();
    let rows = Mat::from_fn(u.nrows(), u.ncols(), |i, j| u[(i, j)] / scale[i]);
    if !rows.is_all_finite() {
        return Err(scale.into_iter().fold(0.0, f64::max));
    }
    let (mut columns, signs) = if u.nrows() > u.ncols() {
        let qr = rows.qr();
        let (found, signs) = terms(qr.thin_R().to_owned(), signs);
        (qr.compute_thin_Q() * found, signs)
    } else {
        terms(rows, signs)
    };
    for (i, scale) in scale.into_iter().enumerate() {
        columns.row_mut(i).iter_mut().for_each(|entry| *entry *= scale);
    }
    Ok((columns, signs))
}

/// As [`pivoted`], of rows as they are.
fn terms(rows: Mat<f64>, signs: &[f64]) -> (Mat<f64>, Vec<f64>) {
    let n = rows.nrows();
    let signed = Mat::from_fn(n, rows.ncols(), |i, j| signs[j] * rows[(i, j)]);
    let mut rest = signed * rows.transpose();
    let made_of = (0..n).map(|i| rows.row(i).squared_norm_l2()).fold(0.0, f64::max);
    let floor = NOISE * made_of;
    let mut found: Vec<(Vec<f64>, f64)> = Vec::new();
    while let Some(pivot) = Pivot::of(rest.as_ref(), floor) {
        let first = found.len();
        let column = |p: usize| rest.col_as_slice(p);
        match pivot {
            Pivot::One(p) => found.push(term(column(p).to_vec(), rest[(p, p)])),
            Pivot::Two(p, q) => {
                let (a, b, c) = (rest[(p, p)], rest[(q, p)], rest[(q, q)]);
                // The eigenvectors of [a b; b c].
                let (sine, cosine) = (0.5 * (2.0 * b).atan2(a - c)).sin_cos();
                for (x, y) in [(cosine, sine), (-sine, cosine)] {
                    let value = x * x * a + 2.0 * x * y * b + y * y * c;
                    let both = column(p).iter().zip(column(q)).map(|(p, q)| x * p + y * q);
                    found.push(term(both.collect(), value));
                }
            }
        }
        for (w, sign) in &found[first..] {
            for (j, factor) in w.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
                let factor = sign * factor;
                let column = rest.col_as_slice_mut(j).iter_mut();
                column.zip(w).for_each(|(entry, w)| *entry -= factor * w);
            }
        }
        for row in pivot.rows() {
            rest.col_mut(row).fill(0.0);
            rest.row_mut(row).fill(0.0);
        }
    }
    let columns = Mat::from_fn(n, found.len(), |i, j| found[j].0[i]);
    (columns, found.into_iter().map(|(_, sign)| sign).collect())
}

/// v vᵀ / d as ± w wᵀ.
fn term(mut v: Vec<f64>, d: f64) -> (Vec<f64>, f64) {
    let root = d.abs().sqrt();
    v.iter_mut().for_each(|entry| *entry /= root);
    (v, d.signum())
}

/// The rows that are eliminated next.
#[derive(Clone, Copy)]
enum Pivot {
    One(usize),
    Two(usize, usize),
}

impl Pivot {
    /// None where no entry is larger than `floor`.
    fn of(matrix: MatRef<'_, f64>, floor: f64) -> Option<Self> {
        let (mut diagonal, mut other) = ((0.0, 0), (0.0, 0, 0));
        for j in 0..matrix.ncols() {
            let entry = matrix[(j, j)].abs();
            if entry > diagonal.0 {
                diagonal = (entry, j);
            }
            for i in j + 1..matrix.nrows() {
                let entry = matrix[(i, j)].abs();
                if entry > other.0 {
                    other = (entry, i, j);
                }
            }
        }
        match diagonal.0 >= ALONE * other.0 {
            true => (diagonal.0 > floor).then_some(Self::One(diagonal.1)),
            false => (other.0 > floor).then_some(Self::Two(other.2, other.1)),
        }
    }

    fn rows(self) -> impl Iterator<Item = usize> {
        let rows = match self {
            Self::One(p) => [Some(p), None],
            Self::Two(p, q) => [Some(p), Some(q)],
        };
        rows.into_iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random columns of either sign, the last ones what cancels others.
    fn random(rows: usize, columns: usize, seed: u64) -> (Mat<f64>, Vec<f64>) {
        let mut state = seed;
        let mut next =
            move || (crate::accuracy::random(&mut state) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        let mut u = Mat::from_fn(rows, columns, |i, _| next() * 10.0_f64.powi(i as i32 % 4 * 3));
        let mut signs: Vec<f64> = (0..columns).map(|_| next().signum()).collect();
        let cancelled = columns / 3;
        for j in 0..cancelled {
            let from = u.col(j).to_owned();
            u.col_mut(columns - 1 - j).copy_from(&from);
            signs[columns - 1 - j] = -signs[j];
        }
        (u, signs)
    }

    #[test]
    fn few_columns_are_the_same_matrix() {
        for (rows, columns) in [(4, 3), (12, 9), (12, 30), (40, 24), (200, 24), (1, 2), (5, 1)] {
            for seed in 0..8 {
                let (u, signs) = random(rows, columns, seed);
                let (w, found) = pivoted(u.as_ref(), &signs).unwrap();
                assert_eq!(w.ncols(), found.len());
                let rank = rows.min(columns - 2 * (columns / 3));
                assert_eq!(found.len(), rank, "{rows} x {columns}");
                for i in 0..rows {
                    for k in 0..rows {
                        let sum = |m: &Mat<f64>, signs: &[f64]| -> f64 {
                            (0..signs.len()).map(|j| signs[j] * m[(i, j)] * m[(k, j)]).sum()
                        };
                        let unit = u.row(i).norm_l2() * u.row(k).norm_l2();
                        let missed = (sum(&u, &signs) - sum(&w, &found)).abs();
                        assert!(missed < 1e-13 * unit, "{rows} x {columns}: {missed:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_cancels_leaves_nothing_and_what_overflows_is_refused() {
        let u = faer::mat![[1e8, 1e8], [3.0, 3.0]];
        assert_eq!(pivoted(u.as_ref(), &[1.0, -1.0]).unwrap().1, []);
        assert!(pivoted(faer::mat![[f64::INFINITY]].as_ref(), &[1.0]).is_err());
        // No diagonal entry is a pivot.
        let swap = faer::mat![[1.0, 1.0], [1.0, -1.0]];
        let (w, signs) = pivoted(swap.as_ref(), &[1.0, -1.0]).unwrap();
        assert_eq!(signs.iter().sum::<f64>(), 0.0);
        let m =
            |i: usize, k: usize| -> f64 { (0..2).map(|j| signs[j] * w[(i, j)] * w[(k, j)]).sum() };
        assert!((m(0, 1) - 2.0).abs() < 1e-15 && m(0, 0).abs() < 1e-15 && m(1, 1).abs() < 1e-15);
    }
}
