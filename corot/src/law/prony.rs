//! `prony`: how moduli relax, as a sum of exponentials (the generalised Maxwell solid).

use nalgebra::Matrix6;
use yawara_embed::MixedModuli;

use crate::error::CorotError;

/// One exponential: a spring and a dashpot in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PronyTerm {
    /// g: its part of the modulus at once.
    pub fraction: f64,
    /// τ, s.
    pub time_s: f64,
}

/// Which part of the stress relaxes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Relaxing {
    /// Changes of shape; changes of volume are elastic.
    #[default]
    Deviator,
    /// All of it.
    Whole,
}

/// G(t)/G(0) = g_∞ + Σ g_i e^(−t/τ_i), g_∞ = 1 − Σ g_i: the elasticity D of the material is that at once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prony {
    terms: Vec<PronyTerm>,
    relaxing: Relaxing,
}

/// Times at which a power law is compared with its fit, for each term.
const SAMPLES: usize = 16;

/// Sweeps of the fit; each costs SAMPLES terms³.
const SWEEPS: usize = 4000;

impl Prony {
    /// # Errors
    /// [`CorotError::Range`] unless all times are finite and more than 0, all fractions at least 0 and their sum
    /// at most 1.
    pub fn new(terms: Vec<PronyTerm>, relaxing: Relaxing) -> Result<Self, CorotError> {
        for PronyTerm { fraction, time_s } in &terms {
            range("the time of a Prony term, s,", *time_s, "a finite number > 0", |t| t > 0.0)?;
            range("the fraction of a Prony term", *fraction, "0 to 1", |g| {
                (0.0..=1.0).contains(&g)
            })?;
        }
        let sum: f64 = terms.iter().map(|term| term.fraction).sum();
        // Fractions that a fit makes sum up to 1 but for rounding.
        range("the sum of the fractions of Prony terms", sum, "at most 1", |sum| {
            sum <= 1.0 + 1e-12
        })?;
        Ok(Self { terms, relaxing })
    }

    /// The terms nearest to G ∝ t^(−`exponent`) from `from_s` to `to_s`, their times evenly spread over the
    /// logarithm of that span, with the largest relative error of G in it. Before `from_s` G levels off,
    /// and so it does after `to_s`: all that an infinite ladder would have there is in the first term and in g_∞.
    ///
    /// Least squares of the relative error with fractions ≥ 0, by projected coordinates.
    ///
    /// # Errors
    /// [`CorotError::Range`] unless 0 < exponent < 1, 0 < from < to, 1 ≤ terms ≤ 32.
    pub fn power_law(
        exponent: f64,
        [from_s, to_s]: [f64; 2],
        terms: usize,
        relaxing: Relaxing,
    ) -> Result<(Self, f64), CorotError> {
        let inside = |x: f64| x > 0.0 && x < 1.0;
        range("the exponent of a power law", exponent, "more than 0 and less than 1", inside)?;
        range("the start of a power law, s,", from_s, "a finite number > 0", |t| t > 0.0)?;
        range("the end of a power law, s,", to_s, "a finite number above its start", |t| {
            t > from_s
        })?;
        let few = |n: f64| (1.0..=32.0).contains(&n);
        range("the number of terms of a power law", terms as f64, "1 to 32", few)?;
        let span = (to_s / from_s).ln();
        let time = |share: f64| from_s * (span * share).exp();
        let times: Vec<f64> = (0..terms).map(|i| time((i as f64 + 0.5) / terms as f64)).collect();
        let count = SAMPLES * terms;
        let samples = (0..=count).map(|k| time(k as f64 / count as f64));
        // Each row over what it is to give: the relative G of every term, and of the constant.
        let rows: Vec<Vec<f64>> = samples
            .map(|t| {
                let scale = (t / from_s).powf(exponent);
                times.iter().map(|tau| scale * (-t / tau).exp()).chain([scale]).collect()
            })
            .collect();
        let mut weights = vec![1.0 / (terms + 1) as f64; terms + 1];
        let mut off: Vec<f64> = rows
            .iter()
            .map(|row| row.iter().zip(&weights).map(|(a, w)| a * w).sum::<f64>() - 1.0)
            .collect();
        for _ in 0..SWEEPS {
            for (i, weight) in weights.iter_mut().enumerate() {
                let slope: f64 = rows.iter().zip(&off).map(|(row, off)| row[i] * off).sum();
                let curvature: f64 = rows.iter().map(|row| row[i] * row[i]).sum();
                let change = (*weight - slope / curvature).max(0.0) - *weight;
                *weight += change;
                off.iter_mut().zip(&rows).for_each(|(off, row)| *off += change * row[i]);
            }
        }
        let sum: f64 = weights.iter().sum();
        let error = off.iter().fold(0.0_f64, |most, off| most.max(off.abs()));
        let terms = times.iter().zip(&weights);
        let terms = terms.map(|(&time_s, w)| PronyTerm { fraction: w / sum, time_s }).collect();
        Ok((Self::new(terms, relaxing)?, error))
    }

    /// The terms.
    pub fn terms(&self) -> &[PronyTerm] {
        &self.terms
    }

    /// Which part of the stress relaxes.
    pub fn relaxing(&self) -> Relaxing {
        self.relaxing
    }

    /// g_∞, what is left after a long time.
    pub fn rest(&self) -> f64 {
        (1.0 - self.terms.iter().map(|term| term.fraction).sum::<f64>()).max(0.0)
    }

    /// G(t)/G(0) at `t` s.
    pub fn relaxation(&self, t: f64) -> f64 {
        self.rest() + self.sum(|time_s| (-t / time_s).exp())
    }

    /// The stress after a step of `step_s` of even strain from rest, over that at once: g_∞ + Σ g_i γ_i,
    /// γ = (1 − e^(−Δt/τ)) τ/Δt.
    pub fn at_step(&self, step_s: f64) -> f64 {
        self.rest() + self.sum(|time_s| lasting(step_s, time_s)[1])
    }

    /// G′ and G″ over G(0) at the angular frequency ω, rad/s.
    pub fn dynamic(&self, omega: f64) -> [f64; 2] {
        let squared = |time_s: f64| (omega * time_s).powi(2);
        let storage = self.sum(|time_s| squared(time_s) / (1.0 + squared(time_s)));
        let loss = self.sum(|time_s| omega * time_s / (1.0 + squared(time_s)));
        [self.rest() + storage, loss]
    }

    /// `elasticity` with the relaxing part times `factor`: all of D, or D − κ m mᵀ with κ = 1/(mᵀD⁻¹m), m of the
    /// unit tensor.
    pub fn scaled(&self, elasticity: &Matrix6<f64>, factor: f64) -> Matrix6<f64> {
        if self.relaxing == Relaxing::Whole {
            return elasticity * factor;
        }
        let mut kept = Matrix6::zeros();
        kept.fixed_view_mut::<3, 3>(0, 0).fill(MixedModuli::split(elasticity).bulk);
        kept + (elasticity - kept) * factor
    }

    fn sum(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.terms.iter().map(|term| term.fraction * of(term.time_s)).sum()
    }
}

/// What a step leaves of a term: a = e^(−Δt/τ) of what it had, and γ = (1 − a) τ/Δt of an even strain.
pub(super) fn lasting(step_s: f64, time_s: f64) -> [f64; 2] {
    let x = step_s / time_s;
    match x > 0.0 {
        // An endless step leaves 0 of both.
        true => [(-x).exp(), -(-x).exp_m1() / x],
        false => [1.0, 1.0],
    }
}

fn range(
    what: &'static str,
    value: f64,
    want: &'static str,
    holds: impl Fn(f64) -> bool,
) -> Result<(), CorotError> {
    match value.is_finite() && holds(value) {
        true => Ok(()),
        false => Err(CorotError::Range { what, value, want }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fitted_power_law_is_as_near_as_it_says_and_gets_nearer_with_terms() {
        let (exponent, span) = (0.2, [1e-2, 1e2]);
        let mut last = f64::INFINITY;
        for terms in [2, 4, 8] {
            let (fit, error) = Prony::power_law(exponent, span, terms, Relaxing::Whole).unwrap();
            // G is c t^(−α) for one c: between the extremes of G t^α.
            let ratio = |k: i32| {
                let t = span[0] * 1e4_f64.powf(f64::from(k) / 50.0);
                fit.relaxation(t) * t.powf(exponent)
            };
            let [least, most] =
                (0..=50).map(ratio).fold([f64::INFINITY, 0.0], |[l, m], r| [l.min(r), m.max(r)]);
            let spread = (most - least) / (most + least);
            println!("{terms} terms: {error} said, {spread} found");
            assert!(spread <= error && error < 0.7 * last, "{terms} terms: {error}, {spread}");
            last = error;
        }
        assert!(last < 0.02);
    }

    #[test]
    fn numbers_of_no_ladder_are_refused() {
        let of =
            |fraction, time_s| Prony::new(vec![PronyTerm { fraction, time_s }; 2], Relaxing::Whole);
        assert!(of(0.5, 1.0).is_ok());
        for (fraction, time_s) in
            [(0.51, 1.0), (-0.1, 1.0), (0.1, 0.0), (0.1, f64::NAN), (f64::NAN, 1.0)]
        {
            assert!(of(fraction, time_s).is_err(), "{fraction} {time_s}");
        }
        for (exponent, from, to, terms) in
            [(0.0, 1.0, 2.0, 3), (0.2, 2.0, 1.0, 3), (0.2, 1.0, 2.0, 0)]
        {
            assert!(Prony::power_law(exponent, [from, to], terms, Relaxing::Whole).is_err());
        }
    }

    /// G′ and G″ belong to the same G: G″/G′ of a power law is tan(απ/2).
    #[test]
    fn a_power_law_loses_the_same_part_at_every_frequency() {
        let (fit, _) = Prony::power_law(0.1, [1e-4, 1e4], 16, Relaxing::Deviator).unwrap();
        for omega in [0.1, 1.0, 10.0] {
            let [storage, loss] = fit.dynamic(omega);
            let want = (0.05 * std::f64::consts::PI).tan();
            assert!((loss / storage / want - 1.0).abs() < 0.03, "{omega}: {}", loss / storage);
        }
    }
}
