//! The one ladder of relaxation times that a swing of one mode calls for.

use std::f64::consts::PI;

use yawara_corot::PronyTerm;

use super::swing::Swing;

/// How many times.
const TIMES: usize = 8;

/// By how much a frequency and a damping ratio may be off, relative: what misfits are counted in.
const TOLERANCES: [f64; 2] = [0.05, 0.15];

/// Exponents and strengths that are looked at.
const EXPONENTS: usize = 126;
const STRENGTHS: usize = 160;

/// A complex number.
type Complex = [f64; 2];

fn product(a: Complex, b: Complex) -> Complex {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

fn quotient(a: Complex, b: Complex) -> Complex {
    let over = b[0] * b[0] + b[1] * b[1];
    product(a, [b[0] / over, -b[1] / over])
}

/// A fitted ladder.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    /// E at once over E after a long time.
    pub stiffer: f64,
    /// Moduli fall by τ to the power of this less.
    pub exponent: f64,
    /// Fractions of the modulus at once.
    pub terms: Vec<PronyTerm>,
}

impl Ladder {
    /// The ladder E(t) = E_∞ (1 + R Σ τ^−α e^(−t/τ)), τ evenly spread over the logarithm of `span` (s), whose mode of
    /// the frequency `rest_hz` at E_∞ comes nearest to `swing` in frequency and damping, among 0 ≤ α ≤ 2.5 and
    /// parts of E_∞ together from .02 to 1.5.
    ///
    /// Two figures need not have a ladder that gives both: what relaxes makes a swing faster as it damps it.
    pub fn fit(swing: &Swing, rest_hz: f64, span: [f64; 2]) -> Self {
        let share = |i: usize| i as f64 / (TIMES - 1) as f64;
        let times = (0..TIMES).map(|i| span[0] * (span[1] / span[0]).powf(share(i)));
        let times: Vec<f64> = times.collect();
        let (mut least, mut best) = (f64::INFINITY, Self::of(&times, 0.0, 0.0));
        for exponent in (0..EXPONENTS).map(|i| 2.5 * i as f64 / (EXPONENTS - 1) as f64) {
            for strength in (0..STRENGTHS).map(|i| 0.02 * 75_f64.powf(i as f64 / STRENGTHS as f64))
            {
                let ladder = Self::of(&times, exponent, strength);
                let [hz, ratio] = ladder.mode(rest_hz);
                let off = [hz / swing.frequency_hz - 1.0, ratio / swing.damping_ratio - 1.0];
                let misfit = (off[0] / TOLERANCES[0]).hypot(off[1] / TOLERANCES[1]);
                if misfit < least {
                    (least, best) = (misfit, ladder);
                }
            }
        }
        best
    }

    /// The one of an exponent whose parts together are `strength` of E_∞.
    fn of(times: &[f64], exponent: f64, strength: f64) -> Self {
        let weights = times.iter().map(|tau| tau.powf(-exponent));
        let all: f64 = weights.clone().sum();
        let stiffer = 1.0 + strength;
        let terms = times.iter().zip(weights);
        let part = |weight: f64| strength * weight / all / stiffer;
        let terms = terms.map(|(&time_s, weight)| PronyTerm { fraction: part(weight), time_s });
        Self { stiffer, exponent, terms: terms.collect() }
    }

    /// Frequency (Hz) and damping ratio of a mode that has `rest_hz` at E_∞: of the root of λ² + ω_∞² E(λ)/E_∞ with
    /// E(λ)/E_∞ = 1 + Σ r λ/(λ + 1/τ), by fixed-point iteration.
    fn mode(&self, rest_hz: f64) -> [f64; 2] {
        let omega = 2.0 * PI * rest_hz;
        let mut lambda = [0.0, omega];
        for _ in 0..40 {
            let mut stiffness = [1.0, 0.0];
            for PronyTerm { fraction, time_s } in &self.terms {
                let term = quotient(lambda, [lambda[0] + 1.0 / time_s, lambda[1]]);
                (0..2).for_each(|i| stiffness[i] += fraction * self.stiffer * term[i]);
            }
            // i ω √E, of the half plane above.
            let size = stiffness[0].hypot(stiffness[1]);
            let root = [(0.5 * (size + stiffness[0])).sqrt(), (0.5 * (size - stiffness[0])).sqrt()];
            lambda = [-omega * root[1], omega * root[0]];
        }
        [lambda[1] / (2.0 * PI), -lambda[0] / lambda[0].hypot(lambda[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One dashpot in a row with a spring: λ³ τ + λ² + ω² (1 + r) τ λ + ω² = 0.
    #[test]
    fn the_mode_is_a_root_and_a_fit_of_what_a_ladder_gives_is_that_ladder() {
        let [rest_hz, tau, r] = [7.0, 0.02, 0.25];
        let ladder = Ladder::of(&[tau], 1.0, r);
        let [hz, ratio] = ladder.mode(rest_hz);
        let (size, w) = (2.0 * PI * hz / (1.0 - ratio * ratio).sqrt(), 2.0 * PI * rest_hz);
        let l = [-ratio * size, 2.0 * PI * hz];
        let (square, cube) = (product(l, l), product(product(l, l), l));
        for i in 0..2 {
            let end = if i == 0 { w * w } else { 0.0 };
            let sum = cube[i] * tau + square[i] + w * w * (1.0 + r) * tau * l[i] + end;
            assert!(sum.abs() < 1e-9 * w * w, "{sum}");
        }
        let made = Ladder::of(&[0.02, 0.2], 0.5, 0.3);
        let [frequency_hz, damping_ratio] = made.mode(rest_hz);
        let swing = Swing { drop_mm: 6.5, frequency_hz, damping_ratio };
        let [hz, ratio] = Ladder::fit(&swing, rest_hz, [0.02, 0.2]).mode(rest_hz);
        assert!(
            (hz / frequency_hz - 1.0).abs() < 5e-3 && (ratio / damping_ratio - 1.0).abs() < 0.02
        );
    }
}
