//! The error that goes with a time.

use faer::Mat;
use yawara_inverse_update::InverseMaintainer;

use crate::error::Result;
use crate::solvers::reference::{Reference, relative_error};
use crate::workloads::random::SplitMix64;

/// ‖C − C_ref‖_F / ‖C_ref‖_F of a maintained inverse C against a fresh one, `reference`.
///
/// The reference is itself rounded: about ε · cond(K) is the least that can be seen. Infinite if
/// the shapes differ or anything is not finite. Cost: O(n²).
/// # Errors
/// `BenchError::Inverse` if the maintainer refuses to hand out its columns.
pub fn inverse_error(maintainer: &dyn InverseMaintainer, reference: &Mat<f64>) -> Result<f64> {
    let slots: Vec<usize> = (0..maintainer.vertices()).collect();
    let kept = maintainer.columns(&slots)?;
    if (kept.nrows(), kept.ncols()) != (reference.nrows(), reference.ncols()) {
        return Ok(f64::INFINITY);
    }
    let error = (&kept - reference).norm_l2() / reference.norm_l2();
    Ok(if error.is_finite() { error } else { f64::INFINITY })
}

/// Loads for which whoever has the inverse is judged, with the reference's solutions.
pub(crate) struct Trial {
    /// Slots of a tool, whose columns are judged too.
    pub tool: Vec<usize>,
    /// The unit loads of the tool, and a random one.
    loads: Vec<Vec<f64>>,
    solutions: Vec<Vec<f64>>,
}

impl Trial {
    /// A tool of three random slots and a random load.
    pub fn new(reference: &Reference, mut random: SplitMix64) -> Result<Self> {
        let rows = reference.rows();
        let tool = random.three_below(rows / 3);
        let unit = |row: usize| (0..rows).map(|i| f64::from(i == row)).collect::<Vec<f64>>();
        let mut loads: Vec<_> =
            tool.iter().flat_map(|slot| [0, 1, 2].map(|a| unit(3 * slot + a))).collect();
        loads.push((0..rows).map(|_| random.symmetric()).collect());
        let solutions = loads.iter().map(|f| reference.solve(f)).collect::<Result<_, _>>()?;
        Ok(Self { tool, loads, solutions })
    }

    /// The largest relative errors of what `solve` makes of the loads, and of the tool's `columns`.
    pub fn errors(
        &self,
        columns: &Mat<f64>,
        solve: impl Fn(&[f64]) -> Result<Vec<f64>>,
    ) -> Result<[f64; 2]> {
        let mut errors = [0.0f64; 2];
        for (j, (load, want)) in self.loads.iter().zip(&self.solutions).enumerate() {
            errors[0] = errors[0].max(relative_error(&solve(load)?, want));
            if j < columns.ncols() {
                errors[1] = errors[1].max(relative_error(columns.col_as_slice(j), want));
            }
        }
        Ok(errors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara_inverse_update::{SparseStiffness, build};

    #[test]
    fn the_error_is_the_relative_frobenius_distance() {
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        k.add(&[0, 1], Mat::from_fn(2, 2, |i, j| if i == j { 0.5 } else { 0.0 }).as_ref()).unwrap();
        let c = build("woodbury", k).unwrap();
        // C = 2 I. The reference differs by (3, 0; 0, 4): 5 / √(5² + 6²).
        let reference = Mat::from_fn(2, 2, |i, j| if i == j { 5.0 + i as f64 } else { 0.0 });
        let error = inverse_error(c.as_ref(), &reference).unwrap();
        assert!((error - 5.0 / 61f64.sqrt()).abs() < 1e-15);
        let nan = Mat::from_fn(2, 2, |_, _| f64::NAN);
        assert_eq!(inverse_error(c.as_ref(), &nan).unwrap(), f64::INFINITY);
        assert_eq!(inverse_error(c.as_ref(), &Mat::zeros(3, 3)).unwrap(), f64::INFINITY);
    }
}
