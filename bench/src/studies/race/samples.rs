//! Times of one operation, and what is said of them.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

use serde::Serialize;

use crate::harness::statistics::{median, milliseconds_since, percentile};

/// Times of one operation, ms, by burst.
#[derive(Clone, Debug, Default)]
pub(crate) struct Samples(BTreeMap<usize, Vec<f64>>);

impl Samples {
    pub fn push(&mut self, burst: usize, milliseconds: f64) {
        self.0.entry(burst).or_default().push(milliseconds);
    }

    pub fn all(&self) -> Vec<f64> {
        self.0.values().flatten().copied().collect()
    }
}

/// Time of a call, ms.
pub(crate) fn timed<T>(call: impl FnOnce() -> T) -> f64 {
    let begin = Instant::now();
    black_box(call());
    milliseconds_since(begin)
}

/// Median over the bursts that both have of the ratio of their medians; NaN without any.
pub(crate) fn ratio(a: &Samples, b: &Samples) -> f64 {
    let of = |(number, times): (&usize, &Vec<f64>)| Some(median(times) / median(b.0.get(number)?));
    median(&a.0.iter().filter_map(of).collect::<Vec<_>>())
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
        let samples = |times: &[(usize, f64)]| {
            let mut samples = Samples::default();
            times.iter().for_each(|&(number, time)| samples.push(number, time));
            samples
        };
        let a = samples(&[(0, 9.0), (0, 6.0), (0, 1.0), (1, 40.0), (2, 5.0)]);
        let b = samples(&[(0, 3.0), (1, 10.0), (3, 7.0)]);
        // 6 / 3 and 40 / 10: the lower median of two.
        assert_eq!(ratio(&a, &b), 2.0);
        assert!(ratio(&a, &samples(&[(4, 1.0)])).is_nan());
    }
}
