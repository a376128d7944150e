//! What a solution leaves of its load, and the step that takes most of that away.

use faer::{Mat, MatRef};

use super::counts::Tally;
use crate::InverseError;
use crate::matrix::{SparseStiffness, check_length, check_vector};

/// The residual ‖D^(−½)(K u − f)‖ / ‖D^(−½) f‖, D = |diag K|, above which a solution is refined.
pub const REFINEMENT_LIMIT: f64 = 1e-11;

/// Rounding of a residual, in units of ε (|K| |u| + |f|).
pub(crate) const ROUNDING: f64 = 4.0;

/// r = f − K u; returns ‖D^(−½) r‖ / ‖D^(−½) f‖ with D = |diag K|: 0 if both are 0.
///
/// All slices have `dofs()` numbers. The norm is scaled by the diagonal, so that neither units nor
/// soft tissue beside stiff tissue decide which rows count. One sweep over K finds product, norms
/// and diagonal. Cost: O(stored entries).
pub(crate) fn residual(k: &SparseStiffness, f: &[f64], u: &[f64], r: &mut [f64]) -> f64 {
    let [left, load] = pulp::Arch::new().dispatch(Sweep { k, f, u, r });
    if left == 0.0 { 0.0 } else { (left / load).sqrt() }
}

struct Sweep<'a> {
    k: &'a SparseStiffness,
    f: &'a [f64],
    u: &'a [f64],
    r: &'a mut [f64],
}

impl pulp::WithSimd for Sweep<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> [f64; 2] {
        // Known numbers of rows let the loops over a block be unrolled.
        match self.k.block() {
            3 => self.rows(3),
            4 => self.rows(4),
            m => self.rows(m),
        }
    }
}

impl Sweep<'_> {
    /// rᵀ D⁻¹ r and fᵀ D⁻¹ f.
    #[inline(always)]
    fn rows(self, m: usize) -> [f64; 2] {
        let Self { k, f, u, r } = self;
        let (mut left, mut load) = (0.0, 0.0);
        for (slot, (target, f)) in r.chunks_exact_mut(m).zip(f.chunks_exact(m)).enumerate() {
            target.copy_from_slice(f);
            let mut own: &[f64] = &[];
            let blocks = k.row_values(slot).chunks_exact(m * m);
            for (&column, value) in k.neighbours(slot).iter().zip(blocks) {
                let source = &u[m * column..][..m];
                for a in 0..m {
                    for b in 0..m {
                        target[a] -= value[m * a + b] * source[b];
                    }
                }
                if column == slot {
                    own = value;
                }
            }
            for (a, (r, f)) in target.iter().zip(f).enumerate() {
                let weight = own.get(a * (m + 1)).map_or(f64::INFINITY, |d| 1.0 / d.abs());
                left += weight * r * r;
                load += weight * f * f;
            }
        }
        [left, load]
    }
}

/// Whether a residual of that relative size, in `r`, is more than rounding of K u itself.
pub(crate) fn exceeds_rounding(k: &SparseStiffness, f: &[f64], u: &[f64], r: &[f64]) -> bool {
    let mut rounding = vec![0.0; f.len()];
    k.apply_absolute(u, &mut rounding);
    rounding.iter_mut().zip(f).for_each(|(sum, f)| *sum += f.abs());
    norm(k, r) > ROUNDING * f64::EPSILON * norm(k, &rounding)
}

/// ‖D^(−½) x‖.
pub(crate) fn norm(k: &SparseStiffness, x: &[f64]) -> f64 {
    let square = |(i, x): (usize, &f64)| x * x / k.diagonal(i).abs();
    x.iter().enumerate().map(square).sum::<f64>().sqrt()
}

/// u = C f, refined once where that helps; `solve` replaces a vector x by C x.
///
/// # Errors
/// [`InverseError::Shape`], [`InverseError::NotFinite`]; those of `solve`.
pub(crate) fn solve_refined(
    k: &SparseStiffness,
    tally: &Tally,
    (f, u): (&[f64], &mut [f64]),
    mut solve: impl FnMut(&mut [f64]) -> Result<(), InverseError>,
) -> Result<(), InverseError> {
    check_vector("f", f, k.dofs())?;
    check_length("u", u, k.dofs())?;
    let mut solution = f.to_vec();
    solve(&mut solution)?;
    let refined = refine_once(k, f, &mut solution, solve)?;
    tally.refined(usize::from(refined));
    u.copy_from_slice(&solution);
    Ok(())
}

/// As [`solve_refined`] for the columns of `loads`, of which `solutions` are given unrefined.
///
/// # Errors
/// [`InverseError::NotFinite`]; those of `solve`.
pub(crate) fn refine_each(
    k: &SparseStiffness,
    tally: &Tally,
    (loads, solutions): (MatRef<'_, f64>, &mut Mat<f64>),
    solve: impl Fn(&mut [f64]) -> Result<(), InverseError>,
) -> Result<(), InverseError> {
    for (j, load) in loads.col_iter().enumerate() {
        let load: Vec<f64> = load.iter().copied().collect();
        let refined = refine_once(k, &load, solutions.col_as_slice_mut(j), &solve)?;
        tally.refined(usize::from(refined));
    }
    Ok(())
}

/// u ← u + C (f − K u), once, if the residual is above [`REFINEMENT_LIMIT`] and above the rounding
/// of K u: below that no step can bring it. Tells whether the step was taken; it is not where it
/// would leave more than before.
///
/// `solve` replaces a vector x by C x. Cost: O(stored entries), and as `solve` for a step.
/// # Errors
/// [`InverseError::NotFinite`] if u is not finite; those of `solve`.
pub(crate) fn refine_once(
    k: &SparseStiffness,
    f: &[f64],
    u: &mut [f64],
    solve: impl FnOnce(&mut [f64]) -> Result<(), InverseError>,
) -> Result<bool, InverseError> {
    let mut step = vec![0.0; f.len()];
    let before = residual(k, f, u, &mut step);
    if before <= REFINEMENT_LIMIT {
        return Ok(false);
    }
    // Only an infinity or a NaN in u, or an overflow that comes close to one, gets here.
    if !before.is_finite() {
        let row = u.iter().position(|value| !value.is_finite()).unwrap_or(0);
        let (what, col, value) = ("the solution", 0, u[row]);
        return Err(InverseError::NotFinite { what, row, col, value });
    }
    if !exceeds_rounding(k, f, u, &step) {
        return Ok(false);
    }
    solve(&mut step)?;
    step.iter_mut().zip(u.iter()).for_each(|(step, u)| *step += u);
    let mut rest = vec![0.0; f.len()];
    let closer = residual(k, f, &step, &mut rest) < before;
    if closer {
        u.copy_from_slice(&step);
    }
    Ok(closer)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every number of rows that has a loop of its own, and others.
    #[test]
    fn the_residual_is_that_of_the_dense_matrix() {
        for block in 1..6 {
            let n = 3 * block;
            let mut k = SparseStiffness::zeros(3, block).unwrap();
            let entry = |i: usize, j: usize| ((i * j + 3 * (i + j)) % 7) as f64;
            let part = |rows: usize| {
                Mat::from_fn(rows, rows, |i, j| entry(i, j) + if i == j { 16.0 } else { 0.0 })
            };
            k.add(&[0, 2], part(2 * block).as_ref()).unwrap();
            k.add(&[1], part(block).as_ref()).unwrap();
            let dense = k.to_dense();
            let f: Vec<f64> = (0..n).map(|i| (i % 5) as f64 - 2.0).collect();
            let u: Vec<f64> = (0..n).map(|i| (i % 3) as f64).collect();
            let want: Vec<f64> =
                (0..n).map(|i| f[i] - (0..n).map(|j| dense[(i, j)] * u[j]).sum::<f64>()).collect();
            let size = |x: &[f64]| (0..n).map(|i| x[i] * x[i] / dense[(i, i)]).sum::<f64>().sqrt();
            let mut r = vec![f64::NAN; n];
            let got = residual(&k, &f, &u, &mut r);
            assert_eq!(r, want, "whole numbers are exact");
            let want = size(&want) / size(&f);
            assert!((got / want - 1.0).abs() < 1e-14, "{got} instead of {want}");
        }
    }

    /// One spring and C = (1 + 1e-3)/K: a step leaves 1e-6 of the load, another would leave 1e-9.
    #[test]
    fn one_step_is_taken_where_it_helps() {
        let mut k = SparseStiffness::zeros(1, 1).unwrap();
        k.add(&[0], Mat::from_fn(1, 1, |_, _| 4.0).as_ref()).unwrap();
        let apply = |factor: f64| {
            move |x: &mut [f64]| {
                x[0] *= factor / 4.0;
                Ok(())
            }
        };
        let mut u = [1.001 / 4.0];
        assert_eq!(refine_once(&k, &[1.0], &mut u, apply(1.001)), Ok(true));
        assert!((4.0 * u[0] - (1.0 - 1e-6)).abs() < 1e-12, "{}", u[0]);
        let mut exact = [0.25];
        assert_eq!(refine_once(&k, &[1.0], &mut exact, apply(1.0)), Ok(false));
        assert_eq!(exact, [0.25]);
        // The step of a C that is off by more than 2 goes too far.
        let mut far = [0.3];
        assert_eq!(refine_once(&k, &[1.0], &mut far, apply(3.0)), Ok(false));
        assert_eq!(far, [0.3]);
        for value in [f64::NAN, f64::INFINITY] {
            let error = refine_once(&k, &[1.0], &mut [value], apply(1.0)).unwrap_err();
            assert!(matches!(error, InverseError::NotFinite { what: "the solution", .. }));
        }
        assert_eq!(refine_once(&k, &[0.0], &mut [0.0], apply(1.0)), Ok(false));
    }
}
