//! Solutions of an inverse stored in f32, refined to f64 accuracy by the sparse matrix itself.

use super::tiles::Panel;
use crate::InverseError;
use crate::accuracy::{Tally, exceeds_rounding, residual};
use crate::matrix::SparseStiffness;

/// The residual to which `woodbury_f32` refines: ‖D^(−½)(K u − f)‖ / ‖D^(−½) f‖, D = |diag K|, if
/// rounding of K u itself allows it.
pub const REFINED_RESIDUAL: f64 = 1e-12;

/// Most steps of refinement per solution.
pub const MOST_REFINEMENTS: usize = 5;

/// A step that leaves more than this of the residual makes no progress.
const PROGRESS: f64 = 0.5;

/// X with K X = F, from `solution` by X ← X + C (F − K X), as long as that brings it closer.
///
/// # Errors
/// [`InverseError::NotRefined`] if it does not come close enough; those of `multiply`.
pub(crate) fn refine_columns(
    method: &'static str,
    stiffness: &SparseStiffness,
    tally: &Tally,
    load: &Panel,
    mut solution: Panel,
    mut multiply: impl FnMut(&Panel) -> Result<Panel, InverseError>,
) -> Result<Panel, InverseError> {
    let mut residuals = Residuals::new(load);
    for steps in 0..=MOST_REFINEMENTS {
        let before = residuals.relative.clone();
        let open = residuals.renew(stiffness, load, &solution);
        if open == 0 {
            return Ok(solution);
        }
        let stuck = |(now, before): (&f64, &f64)| !(*now <= PROGRESS * before);
        let is_stuck = residuals.relative.iter().zip(&before).any(stuck);
        if steps == MOST_REFINEMENTS || (steps > 0 && is_stuck) {
            break;
        }
        let step = multiply(&residuals.panel)?;
        solution.data_mut().iter_mut().zip(step.data()).for_each(|(x, step)| *x += step);
        tally.refined(open);
    }
    let residual = residuals.relative.iter().copied().fold(0.0, f64::max);
    let (steps, limit) = (MOST_REFINEMENTS, REFINED_RESIDUAL);
    Err(InverseError::NotRefined { method, steps, residual, limit })
}

/// F − K X, column by column.
struct Residuals {
    panel: Panel,
    /// ‖D^(−½) r‖ / ‖D^(−½) f‖; 0 where a column is done.
    relative: Vec<f64>,
}

impl Residuals {
    fn new(load: &Panel) -> Self {
        let panel = Panel::zeros(load.rows(), load.columns());
        Self { panel, relative: vec![f64::INFINITY; load.columns()] }
    }

    /// Returns how many columns are not done yet; the residuals of the others are set to 0.
    fn renew(&mut self, stiffness: &SparseStiffness, load: &Panel, solution: &Panel) -> usize {
        let n = load.rows();
        let (mut f, mut u, mut r) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut open = 0;
        for k in 0..load.columns() {
            if self.relative[k] == 0.0 {
                continue;
            }
            load.copy_column(k, &mut f);
            solution.copy_column(k, &mut u);
            let relative = residual(stiffness, &f, &u, &mut r);
            if !relative.is_finite() {
                // An infinity in u: nothing to go on from.
                self.relative[k] = f64::INFINITY;
                open += 1;
                continue;
            }
            let done = relative <= REFINED_RESIDUAL || !exceeds_rounding(stiffness, &f, &u, &r);
            if done {
                r.fill(0.0);
            }
            self.relative[k] = if done { 0.0 } else { relative };
            self.panel.set_column(k, &r);
            open += usize::from(!done);
        }
        open
    }
}
