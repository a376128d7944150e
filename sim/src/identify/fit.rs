//! The least of a sum of squares by damped steps of Gauss and Newton.

use nalgebra::{DMatrix, DVector};

use crate::error::SimError;

/// Values and derivatives of what is fitted, both over the noise's standard deviation.
pub(super) struct Fitted {
    /// (predicted − measured) / sd.
    pub residuals: DVector<f64>,
    /// Its derivatives: a row a residual, a column a parameter.
    pub slopes: DMatrix<f64>,
}

/// Where a fit ended.
pub(super) struct Fit {
    pub parameters: DVector<f64>,
    pub at: Fitted,
    /// (JᵀJ + 1/s²)⁻¹, s the standard deviation of the prior.
    pub covariance: DMatrix<f64>,
    /// Evaluations of values and derivatives.
    pub runs: usize,
    pub converged: bool,
}

/// A step by less than this in every parameter is the last.
const SMALL: f64 = 1e-6;

/// A step goes no farther in any parameter: a factor of four in a modulus.
const FARTHEST: f64 = 1.4;

/// What damping grows and shrinks by, and where it begins, as a part of the diagonal.
const DAMPING: (f64, f64) = (10.0, 1e-3);

/// Minimises ½ ‖r(p)‖² + ½ ‖(p − p₀)/s‖² from p₀ = `start`, in at most `most` evaluations. The prior keeps
/// parameters that nothing measured depends on where they were.
///
/// # Errors
/// Those of `evaluate` at the start; elsewhere a shorter step is tried.
pub(super) fn fit(
    start: &DVector<f64>,
    prior_sd: f64,
    most: usize,
    mut evaluate: impl FnMut(&DVector<f64>) -> Result<Fitted, SimError>,
) -> Result<Fit, SimError> {
    let weight = prior_sd.powi(-2);
    let cost = |at: &Fitted, p: &DVector<f64>| {
        at.residuals.norm_squared() + weight * (p - start).norm_squared()
    };
    let mut parameters = start.clone();
    let mut at = evaluate(&parameters)?;
    let (mut runs, mut converged, mut damping) = (1, false, DAMPING.1);
    while runs < most && !converged {
        let mut curvature = at.slopes.tr_mul(&at.slopes);
        let downhill = -(at.slopes.tr_mul(&at.residuals) + weight * (&parameters - start));
        for i in 0..curvature.nrows() {
            curvature[(i, i)] = (curvature[(i, i)] + weight) * (1.0 + damping);
        }
        let Some(factor) = curvature.cholesky() else { break };
        let mut step = factor.solve(&downhill);
        step *= (FARTHEST / step.amax()).min(1.0);
        converged = step.amax() < SMALL;
        let next = &parameters + step;
        runs += 1;
        match evaluate(&next) {
            Ok(there) if cost(&there, &next) <= cost(&at, &parameters) => {
                (parameters, at) = (next, there);
                damping /= DAMPING.0;
            }
            // What does not go down any more has arrived, but for rounding.
            Ok(_) | Err(_) if converged => {}
            Ok(_) | Err(_) => damping = (damping * DAMPING.0).max(DAMPING.1),
        }
    }
    let mut curvature = at.slopes.tr_mul(&at.slopes);
    for i in 0..curvature.nrows() {
        curvature[(i, i)] += weight;
    }
    let identity = DMatrix::identity(start.len(), start.len());
    let covariance = curvature.cholesky().map_or(identity, |factor| factor.inverse());
    Ok(Fit { parameters, at, covariance, runs, converged })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = a e^(b t) with noise-free values.
    #[test]
    fn an_exponential_is_found_from_afar_and_what_nothing_depends_on_stays() {
        let model = |p: &DVector<f64>| {
            let t = |i: usize| 0.1 * i as f64;
            let y = |i: usize, p: &[f64]| (p[0] + p[1] * t(i)).exp();
            let truth = [1.0, -2.0, 0.0];
            let residuals = DVector::from_fn(20, |i, _| y(i, p.as_slice()) - y(i, &truth));
            let slopes = DMatrix::from_fn(20, 3, |i, j| [1.0, t(i), 0.0][j] * y(i, p.as_slice()));
            Ok(Fitted { residuals, slopes })
        };
        let start = DVector::from_vec(vec![-1.0, 2.0, 0.7]);
        let found = fit(&start, 1e4, 50, model).unwrap();
        assert!(found.converged && found.runs < 30, "{} runs", found.runs);
        let off = (&found.parameters - DVector::from_vec(vec![1.0, -2.0, 0.7])).amax();
        assert!(off < 1e-6, "{off:.1e}");
        assert!((found.covariance[(2, 2)].sqrt() - 1e4).abs() < 1.0);
    }

    #[test]
    fn what_can_be_evaluated_nowhere_else_ends_where_it_began() {
        let mut count = 0;
        let found = fit(&DVector::from_vec(vec![1.0]), 10.0, 6, |p| {
            count += 1;
            match count {
                1 => Ok(Fitted { residuals: p.clone(), slopes: DMatrix::identity(1, 1) }),
                _ => Err(SimError::NoResponse(1)),
            }
        });
        let found = found.unwrap();
        assert_eq!((found.parameters[0], found.runs, found.converged), (1.0, 6, false));
    }
}
