//! The memory bound that updates of a dense inverse are measured against.

use std::hint::black_box;
use std::time::Instant;

use rayon::prelude::*;

/// Bytes that a thread takes at a time: sixteen tiles of 48 × 48 numbers of 8 bytes.
const GROUP: usize = 16 * 48 * 48 * 8;

/// Bytes from which on threads share a pass, as they share an update of the dense inverse.
const PARALLEL_FROM: usize = 8 << 20;

/// Blocks of numbers to read and write once, from one end to the other.
#[derive(Clone, Debug)]
pub struct Stream {
    data: Vec<f64>,
}

/// How fast this machine goes over memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// One pass, ms: the best of the repeats.
    pub pass_ms: f64,
    /// Bytes read plus bytes written by a pass per time, GB/s.
    pub pass_gb_s: f64,
    /// The same for a copy from one half of the block to the other, GB/s.
    pub copy_gb_s: f64,
}

impl Stream {
    /// Room for passes over up to `numbers` numbers of 8 bytes; all pages are touched here.
    pub fn new(numbers: usize) -> Self {
        Self { data: vec![1.0; numbers] }
    }

    /// Reads, changes and writes the first `numbers` numbers (or all, if there are fewer), in the
    /// pieces and with the threads of an update of the dense inverse. Returns the bytes that it
    /// went over, each read and written once.
    pub fn pass(&mut self, numbers: usize) -> usize {
        let count = numbers.min(self.data.len());
        let factor = black_box(-1.0);
        each(&mut self.data[..count], |piece| pulp::Arch::new().dispatch(Scale { piece, factor }));
        black_box(&self.data);
        count * size_of::<f64>()
    }

    /// Copies the first `numbers` numbers of the one half into the other (or all of it, if there
    /// are fewer), in the same pieces. Returns the bytes copied.
    pub fn copy(&mut self, numbers: usize) -> usize {
        let half = self.data.len() / 2;
        let count = numbers.min(half);
        let (source, target) = self.data.split_at_mut(half);
        let (source, target) = (&source[..count], &mut target[..count]);
        if is_large(count) {
            let size = GROUP / size_of::<f64>();
            let pieces = target.par_chunks_mut(size).zip(source.par_chunks(size));
            pieces.for_each(|(target, source)| target.copy_from_slice(source));
        } else {
            target.copy_from_slice(source);
        }
        black_box(&self.data);
        count * size_of::<f64>()
    }

    /// Times passes over `numbers` numbers and copies of half as many, so that both go over the
    /// same memory, in turns; the best of `repeats`.
    pub fn bound(&mut self, numbers: usize, repeats: usize) -> Bound {
        let (mut pass, mut copy) = (f64::INFINITY, f64::INFINITY);
        let (mut passed, mut copied) = (0, 0);
        for _ in 0..repeats {
            let begin = Instant::now();
            passed = self.pass(numbers);
            pass = pass.min(begin.elapsed().as_secs_f64());
            let begin = Instant::now();
            copied = self.copy(numbers / 2);
            copy = copy.min(begin.elapsed().as_secs_f64());
        }
        Bound {
            pass_ms: 1e3 * pass,
            pass_gb_s: 2e-9 * passed as f64 / pass,
            copy_gb_s: 2e-9 * copied as f64 / copy,
        }
    }
}

fn is_large(numbers: usize) -> bool {
    numbers * size_of::<f64>() >= PARALLEL_FROM && rayon::current_num_threads() > 1
}

fn each(data: &mut [f64], work: impl Fn(&mut [f64]) + Send + Sync) {
    if is_large(data.len()) {
        data.par_chunks_mut(GROUP / size_of::<f64>()).for_each(work);
    } else {
        work(data);
    }
}

struct Scale<'a> {
    piece: &'a mut [f64],
    factor: f64,
}

impl pulp::WithSimd for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.piece.iter_mut().for_each(|x| *x *= self.factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pass_changes_exactly_its_numbers() {
        let mut stream = Stream::new(5);
        assert_eq!(stream.pass(3), 24);
        assert_eq!(stream.data, [-1.0, -1.0, -1.0, 1.0, 1.0]);
        assert_eq!(stream.pass(9), 40);
        assert_eq!(stream.data, [1.0, 1.0, 1.0, -1.0, -1.0]);
        assert_eq!(stream.copy(9), 16);
        assert_eq!(stream.data, [1.0, 1.0, 1.0, 1.0, -1.0]);
    }

    #[test]
    fn a_large_pass_does_too() {
        let mut stream = Stream::new(PARALLEL_FROM / 4 + 3);
        let count = PARALLEL_FROM / 8 + 1;
        assert_eq!(stream.pass(count), 8 * count);
        assert!(stream.data[..count].iter().all(|x| *x == -1.0));
        assert!(stream.data[count..].iter().all(|x| *x == 1.0));
        assert_eq!(stream.copy(count), 8 * count);
        assert!(stream.data[count + 1..2 * count + 1].iter().all(|x| *x == -1.0));
        assert_eq!(stream.data[2 * count + 1], 1.0);
    }

    #[test]
    fn a_bound_is_what_was_timed() {
        let bound = Stream::new(1 << 16).bound(1 << 15, 3);
        let bytes = f64::from(1 << 15) * 8.0;
        assert!((bound.pass_gb_s * bound.pass_ms * 1e6 / (2.0 * bytes) - 1.0).abs() < 1e-12);
        assert!(bound.copy_gb_s > 0.0 && bound.copy_gb_s.is_finite());
    }
}
