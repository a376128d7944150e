//! Solutions brought closer by their residuals: by one step where C is kept in f64, to f64 accuracy
//! by several where it is kept in f32.

use faer::{Mat, MatRef};

use super::residual::{exceeds_rounding, residual};
use crate::InverseError;
use crate::matrix::SparseStiffness;

/// The residual ‖D^(−½)(K u − f)‖ / ‖D^(−½) f‖, D = |diag K|, above which a solution is refined.
pub const REFINEMENT_LIMIT: f64 = 1e-11;

/// The residual to which `woodbury_f32` refines, scaled as [`REFINEMENT_LIMIT`], if rounding of K u
/// itself allows it.
pub const REFINED_RESIDUAL: f64 = 1e-12;

/// Most steps of refinement per solution.
pub const MOST_REFINEMENTS: usize = 5;

/// A step that leaves more than this of the residual makes no progress.
const PROGRESS: f64 = 0.5;

/// Refines each of some solutions once where that helps; `multiply` gives C X, and `steps` counts. Tells whether all are
/// within [`REFINEMENT_LIMIT`] then, or as close as rounding of K u lets them: where not, C is no longer K's inverse.
/// # Errors
/// [`InverseError::NotFinite`]; those of `multiply`.
pub(crate) fn refine_each(
    k: &SparseStiffness,
    loads: MatRef<'_, f64>,
    mut solutions: Mat<f64>,
    multiply: impl Fn(MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>,
    steps: &mut usize,
) -> Result<(Mat<f64>, bool), InverseError> {
    let mut are_close = true;
    for (j, load) in loads.col_iter().enumerate() {
        let load: Vec<f64> = load.iter().copied().collect();
        let refined = refine_once(k, &load, solutions.col_as_slice_mut(j), &multiply)?;
        *steps += usize::from(refined.is_changed);
        are_close &= refined.is_close;
    }
    Ok((solutions, are_close))
}

/// What [`refine_once`] has done.
#[derive(Debug, PartialEq)]
struct Refined {
    is_changed: bool,
    /// Whether what is left is within the limit, or rounding.
    is_close: bool,
}

/// u ← u + C (f − K u), once, if the residual is above [`REFINEMENT_LIMIT`] and above the rounding
/// of K u: below that no step can bring it. A step is not taken where it would leave more than before.
///
/// Cost: O(stored entries), and a product with C for a step.
/// # Errors
/// [`InverseError::NotFinite`] if u is not finite; those of `multiply`.
fn refine_once(
    k: &SparseStiffness,
    f: &[f64],
    u: &mut [f64],
    multiply: impl Fn(MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>,
) -> Result<Refined, InverseError> {
    let as_it_is = Refined { is_changed: false, is_close: true };
    let mut rest = vec![0.0; f.len()];
    let before = residual(k, f, u, &mut rest);
    if before <= REFINEMENT_LIMIT {
        return Ok(as_it_is);
    }
    // Only an infinity or a NaN in u, or an overflow that comes close to one, gets here.
    if !before.is_finite() {
        let row = u.iter().position(|value| !value.is_finite()).unwrap_or(0);
        let (what, col, value) = ("the solution", 0, u[row]);
        return Err(InverseError::NotFinite { what, row, col, value });
    }
    if !exceeds_rounding(k, f, u, &rest) {
        return Ok(as_it_is);
    }
    let mut step = multiply(MatRef::from_column_major_slice(&rest, f.len(), 1))?;
    let refined = step.col_as_slice_mut(0);
    refined.iter_mut().zip(u.iter()).for_each(|(step, u)| *step += u);
    let after = residual(k, f, refined, &mut rest);
    if !(after < before) {
        return Ok(Refined { is_changed: false, is_close: false });
    }
    u.copy_from_slice(refined);
    let is_close = after <= REFINEMENT_LIMIT || !exceeds_rounding(k, f, u, &rest);
    Ok(Refined { is_changed: true, is_close })
}

/// X with K X = F, from `solutions` by X ← X + C (F − K X), as long as that brings it closer.
/// # Errors
/// [`InverseError::NotRefined`] if it does not come close enough; those of `multiply`.
pub(crate) fn refine_columns(
    method: &'static str,
    k: &SparseStiffness,
    loads: MatRef<'_, f64>,
    mut solutions: Mat<f64>,
    multiply: impl Fn(MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>,
    counted: &mut usize,
) -> Result<Mat<f64>, InverseError> {
    let mut residuals = Mat::zeros(loads.nrows(), loads.ncols());
    // ‖D^(−½) r‖ / ‖D^(−½) f‖ of each column; 0 where it is done.
    let mut relative = vec![f64::INFINITY; loads.ncols()];
    for steps in 0..=MOST_REFINEMENTS {
        let before = relative.clone();
        renew(k, loads, &solutions, &mut residuals, &mut relative);
        let open = relative.iter().filter(|&&relative| relative > 0.0).count();
        if open == 0 {
            return Ok(solutions);
        }
        let stuck = |(now, before): (&f64, &f64)| !(*now <= PROGRESS * before);
        let is_stuck = relative.iter().zip(&before).any(stuck);
        if steps == MOST_REFINEMENTS || (steps > 0 && is_stuck) {
            break;
        }
        solutions += multiply(residuals.as_ref())?;
        *counted += open;
    }
    let residual = relative.iter().copied().fold(0.0, f64::max);
    let (steps, limit) = (MOST_REFINEMENTS, REFINED_RESIDUAL);
    Err(InverseError::NotRefined { method, steps, residual, limit })
}

/// Computes F − K X and its relative sizes for the columns that are not done; what is left of the
/// others is 0.
fn renew(
    k: &SparseStiffness,
    loads: MatRef<'_, f64>,
    solutions: &Mat<f64>,
    residuals: &mut Mat<f64>,
    relative: &mut [f64],
) {
    for (j, load) in loads.col_iter().enumerate() {
        if relative[j] == 0.0 {
            continue;
        }
        let load: Vec<f64> = load.iter().copied().collect();
        let (u, r) = (solutions.col_as_slice(j), residuals.col_as_slice_mut(j));
        let size = residual(k, &load, u, r);
        relative[j] = match size.is_finite() {
            true if size <= REFINED_RESIDUAL || !exceeds_rounding(k, &load, u, r) => 0.0,
            true => size,
            // From an infinity in u there is nothing to go on.
            false => f64::INFINITY,
        };
        if relative[j] == 0.0 || relative[j].is_infinite() {
            r.fill(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One spring and C = (1 + 1e-3)/K: a step leaves 1e-6 of the load, another would leave 1e-9.
    #[test]
    fn one_step_is_taken_where_it_helps() {
        let mut k = SparseStiffness::zeros(1, 1).unwrap();
        k.add(&[0], Mat::from_fn(1, 1, |_, _| 4.0).as_ref()).unwrap();
        let apply = |factor: f64| move |x: MatRef<'_, f64>| Ok(x * faer::Scale(factor / 4.0));
        let mut u = [1.001 / 4.0];
        let refined = |is_changed, is_close| Ok(Refined { is_changed, is_close });
        assert_eq!(refine_once(&k, &[1.0], &mut u, apply(1.001)), refined(true, false));
        assert!((4.0 * u[0] - (1.0 - 1e-6)).abs() < 1e-12, "{}", u[0]);
        let mut exact = [0.25];
        assert_eq!(refine_once(&k, &[1.0], &mut exact, apply(1.0)), refined(false, true));
        assert_eq!(exact, [0.25]);
        let mut near = [0.25 * (1.0 + 1e-7)];
        assert_eq!(refine_once(&k, &[1.0], &mut near, apply(1.0 + 1e-7)), refined(true, true));
        // The step of a C that is off by more than 2 goes too far.
        let mut far = [0.3];
        assert_eq!(refine_once(&k, &[1.0], &mut far, apply(3.0)), refined(false, false));
        assert_eq!(far, [0.3]);
        for value in [f64::NAN, f64::INFINITY] {
            let error = refine_once(&k, &[1.0], &mut [value], apply(1.0)).unwrap_err();
            assert!(matches!(error, InverseError::NotFinite { what: "the solution", .. }));
        }
        assert_eq!(refine_once(&k, &[0.0], &mut [0.0], apply(1.0)), refined(false, true));
    }
}
