//! Reproducible choices.

use std::f64::consts::TAU;

use nalgebra::Vector3;

/// SplitMix64 (Steele, Lea, Flood 2014): good enough to pick rings, the same everywhere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplitMix64(pub u64);

impl SplitMix64 {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in `0..count`; 0 if `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        (self.next() % (count as u64).max(1)) as usize
    }

    /// Three different numbers in `0..count`, fewer if there are fewer.
    pub fn three_below(&mut self, count: usize) -> Vec<usize> {
        let mut three = Vec::new();
        while three.len() < 3.min(count) {
            let number = self.below(count);
            if !three.contains(&number) {
                three.push(number);
            }
        }
        three
    }

    /// A number in −1..1.
    pub fn symmetric(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// A number in `low`..`high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (high - low) * (self.symmetric() + 1.0)
    }

    /// A number of the standard normal distribution (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let [u, v] = [0, 1].map(|_| 0.5 * (self.symmetric() + 1.0));
        (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
    }

    /// A unit vector, all directions alike.
    pub fn direction(&mut self) -> Vector3<f64> {
        let (z, turn) = (self.symmetric(), self.between(0.0, TAU));
        let radius = (1.0 - z * z).sqrt();
        Vector3::new(radius * turn.cos(), radius * turn.sin(), z)
    }
}
