//! Times of one operation, and what is said of them.

use std::hint::black_box;
use std::time::Instant;

use serde::Serialize;

use crate::harness::statistics::{median, percentile};

/// Times of one operation, ms, by burst.
#[derive(Clone, Debug, Default)]
pub(crate) struct Samples {
    bursts: Vec<(usize, Vec<f64>)>,
}

impl Samples {
    pub fn push(&mut self, burst: usize, milliseconds: f64) {
        match self.bursts.last_mut() {
            Some((number, times)) if *number == burst => times.push(milliseconds),
            _ => self.bursts.push((burst, vec![milliseconds])),
        }
    }

    pub fn bursts(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.bursts.iter().map(|(number, times)| (*number, times.as_slice()))
    }

    pub fn burst(&self, number: usize) -> Option<&[f64]> {
        self.bursts().find(|(other, _)| *other == number).map(|(_, times)| times)
    }

    pub fn all(&self) -> Vec<f64> {
        self.bursts.iter().flat_map(|(_, times)| times.iter().copied()).collect()
    }
}

/// Time of a call, ms.
pub(crate) fn timed<T>(call: impl FnOnce() -> T) -> f64 {
    let begin = Instant::now();
    black_box(call());
    begin.elapsed().as_secs_f64() * 1e3
}

/// Median over the bursts that both have of the ratio of their medians; NaN without any.
pub(crate) fn ratio(a: &Samples, b: &Samples) -> f64 {
    let ratios: Vec<f64> = a
        .bursts()
        .filter_map(|(number, times)| Some(median(times) / median(b.burst(number)?)))
        .collect();
    median(&ratios)
}

/// Median and 99th percentile by nearest rank, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Quantiles {
    pub p50: f64,
    pub p99: f64,
}

impl Quantiles {
    /// None without samples.
    pub fn of(samples: &Samples) -> Option<Self> {
        let all = samples.all();
        let some = !all.is_empty();
        some.then(|| Self { p50: median(&all), p99: percentile(&all, 99.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_compare_bursts_that_both_have() {
        let samples = |bursts: &[(usize, f64)]| {
            let mut samples = Samples::default();
            bursts.iter().for_each(|&(number, time)| samples.push(number, time));
            samples
        };
        let a = samples(&[(0, 9.0), (0, 6.0), (0, 1.0), (1, 40.0), (2, 5.0)]);
        let b = samples(&[(0, 3.0), (1, 10.0), (3, 7.0)]);
        // 6 / 3 and 40 / 10: the lower median of two.
        assert_eq!(ratio(&a, &b), 2.0);
        assert!(ratio(&a, &samples(&[(4, 1.0)])).is_nan());
    }
}
