//! The one ladder of relaxation times that a swing of one mode calls for.

use std::f64::consts::PI;

use yawara_corot::PronyTerm;

use super::swing::Swing;

/// How many times.
const TIMES: usize = 8;

/// Exponents that are looked at, and how finely.
const STEEPEST: f64 = 2.0;
const STEPS: usize = 4000;

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
    /// The ladder E(t) = E_∞ (1 + R Σ τ^−α e^(−t/τ)), τ evenly spread over the logarithm from `span[0]` to `span[1]` s,
    /// with which a mode that has the frequency `rest_hz` with E_∞ swings as `swing` says; none where no R > 0 and
    /// |α| < 2 do.
    ///
    /// A mode of the eigenvalue λ has λ² + ω_∞² (1 + R Σ τ^−α λ/(λ + 1/τ)) = 0: the phase gives α, the size R.
    pub fn fit(swing: &Swing, rest_hz: f64, span: [f64; 2]) -> Option<Self> {
        let omega = 2.0 * PI * swing.frequency_hz;
        let zeta = swing.damping_ratio;
        let lambda = [-zeta / (1.0 - zeta * zeta).sqrt() * omega, omega];
        let square = product(lambda, lambda).map(|x| x / (2.0 * PI * rest_hz).powi(2));
        let want = [-square[0] - 1.0, -square[1]];
        let share = |i: usize| i as f64 / (TIMES - 1) as f64;
        let times = (0..TIMES).map(|i| span[0] * (span[1] / span[0]).powf(share(i)));
        let times: Vec<f64> = times.collect();
        let sum = |exponent: f64| {
            times.iter().fold([0.0; 2], |sum: Complex, tau| {
                let term = quotient(lambda, [lambda[0] + 1.0 / tau, lambda[1]]);
                let weight = tau.powf(-exponent);
                [sum[0] + weight * term[0], sum[1] + weight * term[1]]
            })
        };
        // The sine of the angle between the two.
        let turn = |exponent: f64| product(sum(exponent), [want[0], -want[1]])[1];
        let exponents = (0..=STEPS).map(|i| STEEPEST * (2.0 * i as f64 / STEPS as f64 - 1.0));
        let exponents: Vec<f64> = exponents.collect();
        let is_root = |pair: &&[f64]| turn(pair[0]) * turn(pair[1]) <= 0.0;
        let root = exponents.windows(2).find(is_root)?;
        let [a, b] = [turn(root[0]), turn(root[1])];
        let exponent = root[0] + (root[1] - root[0]) * a / (a - b);
        let strength = quotient(want, sum(exponent))[0];
        let parts: Vec<f64> = times.iter().map(|tau| strength * tau.powf(-exponent)).collect();
        let stiffer = 1.0 + parts.iter().sum::<f64>();
        let terms = times.iter().zip(parts);
        let terms = terms.map(|(&time_s, part)| PronyTerm { fraction: part / stiffer, time_s });
        (strength > 0.0).then(|| Self { stiffer, exponent, terms: terms.collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mode_of_the_fitted_ladder_is_the_one_that_was_asked_for() {
        let swing = Swing { drop_mm: 6.5, frequency_hz: 7.7, damping_ratio: 0.05 };
        let ladder = Ladder::fit(&swing, 7.0, [0.01, 4.0]).unwrap();
        // Newton's method for the root of λ² + ω² E(λ)/E_∞, from nearby.
        let omega = 2.0 * PI * 7.0;
        let f = |l: Complex| {
            let mut sum = [1.0, 0.0];
            for PronyTerm { fraction, time_s } in &ladder.terms {
                let term = quotient(l, [l[0] + 1.0 / time_s, l[1]]);
                (0..2).for_each(|i| sum[i] += fraction * ladder.stiffer * term[i]);
            }
            let square = product(l, l);
            [0, 1].map(|i| square[i] / (omega * omega) + sum[i])
        };
        let mut l = [-1.0, 2.0 * PI * 7.4];
        for _ in 0..50 {
            let h = 1e-6;
            let [up, down] = [f([l[0] + h, l[1]]), f([l[0] - h, l[1]])];
            let slope = [0, 1].map(|i| (up[i] - down[i]) / (2.0 * h));
            let step = quotient(f(l), slope);
            l = [l[0] - step[0], l[1] - step[1]];
        }
        assert!((l[1] / (2.0 * PI * 7.7) - 1.0).abs() < 1e-5, "{l:?}");
        assert!((-l[0] / l[0].hypot(l[1]) / 0.05 - 1.0).abs() < 1e-4, "{l:?}");
        // A swing as fast as at rest that is damped all the same has no ladder.
        assert_eq!(Ladder::fit(&swing, 7.8, [0.01, 4.0]), None);
    }
}
