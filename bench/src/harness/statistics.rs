//! Times, and what is said of a sample of them.

use std::time::Instant;

/// Milliseconds from `begin` to now.
pub(crate) fn milliseconds_since(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

/// The value that `percent` of the samples do not exceed, by nearest rank: sample ⌈p·n/100⌉ of the
/// ascending ones. NaN without samples or if a sample is NaN.
pub fn percentile(samples: &[f64], percent: f64) -> f64 {
    if samples.is_empty() || samples.iter().any(|x| x.is_nan()) {
        return f64::NAN;
    }
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (percent * sorted.len() as f64 / 100.0).ceil() as usize;
    sorted[rank.clamp(1, sorted.len()) - 1]
}

/// The 50th [`percentile`].
pub fn median(samples: &[f64]) -> f64 {
    percentile(samples, 50.0)
}

/// a_i / b_i of paired samples: both sides of a pair met the same state of the machine, so the
/// median of the ratios is steadier than the ratio of the medians.
pub fn ratios(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a / b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_rank() {
        let samples: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        assert_eq!(median(&samples), 100.0);
        assert_eq!(percentile(&samples, 99.0), 198.0);
        assert_eq!(percentile(&samples, 100.0), 200.0);
        assert_eq!(median(&[5.0, 1.0, 3.0]), 3.0);
        assert_eq!(percentile(&[3.0], 1.0), 3.0);
        // No number comes from nothing or NaN.
        assert!(median(&[]).is_nan());
        assert!(median(&[1.0, f64::NAN, 2.0]).is_nan());
    }

    #[test]
    fn ratios_are_taken_pair_by_pair() {
        assert_eq!(ratios(&[2.0, 9.0], &[1.0, 3.0]), [2.0, 3.0]);
    }
}
