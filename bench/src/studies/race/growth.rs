//! What the sizes so far say of the next one.

use std::collections::HashMap;

use super::settings::is_sparse;
use crate::harness::plot::slope;
use crate::harness::statistics::median;

/// Method, family and operation.
pub(crate) type Key = (&'static str, &'static str, &'static str);

/// Times by rows of K, and powers fitted to them.
#[derive(Debug, Default)]
pub(crate) struct Growth {
    times: HashMap<Key, Vec<(f64, f64)>>,
}

impl Growth {
    /// Enters a time, ms.
    pub fn note(&mut self, key: Key, dofs: usize, milliseconds: f64) {
        self.times.entry(key).or_default().push((dofs as f64, milliseconds));
    }

    /// The time by the power fitted to the sizes so far, ms. None with fewer than two.
    pub fn fitted(&self, key: Key, dofs: usize) -> Option<f64> {
        let points = self.times.get(&key).filter(|points| points.len() > 1)?;
        Some(along(points, slope(points), dofs))
    }

    /// The time that a next size may be held against a limit with: as [`fitted`](Self::fitted),
    /// but with a power that theory allows, since two small sizes can be off by any. From a single
    /// size by the power of theory; none without any.
    pub fn expect(&self, key: Key, dofs: usize) -> Option<f64> {
        let points = self.times.get(&key)?;
        let (low, high) = if is_sparse(key.0) { (1.0, 2.0) } else { (2.5, 3.0) };
        let power = if points.len() > 1 { slope(points).clamp(low, high) } else { high };
        Some(along(points, power, dofs))
    }
}

/// The line of this slope through the middle of the points, at `dofs`.
fn along(points: &[(f64, f64)], power: f64, dofs: usize) -> f64 {
    let factors: Vec<f64> = points.iter().map(|(x, y)| y / x.powf(power)).collect();
    median(&factors) * (dofs as f64).powf(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: Key = ("lu", "rank3", "split");

    #[test]
    fn a_power_goes_on_beyond_the_last_size() {
        let mut growth = Growth::default();
        assert_eq!(growth.expect(KEY, 1000), None);
        growth.note(KEY, 100, 2.0);
        assert_eq!(growth.fitted(KEY, 1000), None);
        // Of one size nothing but the theory is known.
        assert!((growth.expect(KEY, 1000).unwrap() - 2e3).abs() < 1e-9);
        growth.note(KEY, 200, 2.0 * 2f64.powf(2.5));
        let want = 2.0 * 10f64.powf(2.5);
        assert!((growth.fitted(KEY, 1000).unwrap() - want).abs() < 1e-9 * want);
        assert_eq!(growth.fitted(("lu", "laminate", "split"), 1000), None);
    }

    #[test]
    fn two_disturbed_sizes_forbid_nothing() {
        let key = ("sparse", "rank3", "build");
        let mut growth = Growth::default();
        growth.note(key, 100, 1.0);
        growth.note(key, 200, 32.0);
        // A power of 5 in the data, one of 2 in what is expected: 1 and 32 / 4 at 100 rows.
        let (low, high) = (1e4, 8e4);
        let expected = growth.expect(key, 10_000).unwrap();
        assert!((0.99 * low..1.01 * high).contains(&expected), "{expected}");
    }
}
