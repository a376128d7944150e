//! The bound of memory, measured beside the methods.

use serde::Serialize;

use super::samples::{Quantiles, Samples, timed};
use super::settings::BURST;
use crate::harness::machine::gigabytes_per_second;
use crate::solvers::stream::Stream;

/// Passes over as many numbers as half of C has, in the turns of the methods.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    numbers: usize,
    double: Stream,
    /// Half as many bytes, in a place of their own: the caches can't know them from the others.
    single: Stream,
    /// One pass in f64, ms.
    pub pass: Samples,
    /// One pass in f32, ms.
    pub pass_f32: Samples,
    /// As many bytes read and written by the system's `memcpy`, ms.
    pub copy: Samples,
    /// The first passes of each burst, f64 and f32.
    cold: [Samples; 2],
}

impl Memory {
    /// Room for passes over `numbers` numbers.
    pub fn new(numbers: usize) -> Self {
        let (double, single) = (Stream::new(numbers), Stream::new(numbers / 2));
        Self { numbers, double, single, ..Self::default() }
    }

    /// As many passes as a method has updates; none without room.
    pub fn burst(&mut self, number: usize) {
        if self.numbers == 0 {
            return;
        }
        let (count, nowhere) = (self.numbers, &mut Samples::default());
        repeat(number, &mut self.cold[0], &mut self.pass, || self.double.pass(count));
        repeat(number, &mut self.cold[1], &mut self.pass_f32, || self.single.pass(count / 2));
        repeat(number, nowhere, &mut self.copy, || self.double.copy(count));
    }

    /// Passes in that precision, and those that begin a burst.
    pub fn bound(&self, precision: &str) -> [&Samples; 2] {
        let [cold, cold_f32] = &self.cold;
        if precision == "f32" { [&self.pass_f32, cold_f32] } else { [&self.pass, cold] }
    }

    /// Lets go of the room; the times stay.
    pub fn free(&mut self) {
        self.double = Stream::default();
        self.single = Stream::default();
    }

    /// What the passes in f64 say at a size; none without passes.
    pub fn speed(&self, vertices: usize) -> Option<Speed> {
        let bytes = size_of::<f64>() * self.numbers;
        let speed = |samples| Some(gigabytes_per_second(bytes, Quantiles::of(samples)?.p50 / 1e3));
        Some(Speed {
            vertices,
            bytes,
            cold_pass_gb_s: speed(&self.cold[0])?,
            pass_gb_s: speed(&self.pass)?,
            memcpy_gb_s: speed(&self.copy)?,
        })
    }
}

/// The bound at one size, 10⁹ bytes per second read and written.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Speed {
    pub vertices: usize,
    /// Of a pass.
    pub bytes: usize,
    /// Of a pass that begins a burst, of any other, and of a copy.
    pub cold_pass_gb_s: f64,
    pub pass_gb_s: f64,
    pub memcpy_gb_s: f64,
}

/// As often as a burst has updates: the first counts apart, the second not at all.
fn repeat(burst: usize, cold: &mut Samples, others: &mut Samples, mut pass: impl FnMut() -> usize) {
    cold.push(burst, timed(&mut pass));
    pass();
    (0..2 * BURST).for_each(|_| others.push(burst, timed(&mut pass)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_passes_as_updates_the_first_apart() {
        let mut memory = Memory::new(1 << 20);
        memory.burst(0);
        memory.burst(1);
        memory.free();
        let [pass, cold] = memory.bound("f64");
        assert_eq!((pass.all().len(), cold.all().len()), (2 * 2 * BURST, 2));
        let [single, cold] = memory.bound("f32");
        assert_eq!((single.all().len(), cold.all().len()), (2 * 2 * BURST, 2));
        assert_eq!(memory.copy.all().len(), 2 * 2 * BURST);
        let Speed { bytes, cold_pass_gb_s, pass_gb_s, memcpy_gb_s, .. } = memory.speed(9).unwrap();
        assert_eq!(bytes, 8 << 20);
        assert!([cold_pass_gb_s, pass_gb_s, memcpy_gb_s].iter().all(|speed| *speed > 0.01));
        // Without room there are no times.
        let mut memory = Memory::default();
        memory.burst(0);
        assert!(memory.pass.all().is_empty() && memory.speed(9).is_none());
    }
}
