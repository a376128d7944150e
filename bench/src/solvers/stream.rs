//! The memory bound that updates of a dense inverse are measured against.

use std::hint::black_box;

use rayon::prelude::*;

/// Bytes that a thread takes at a time: sixteen tiles of 48 × 48 numbers of 8 bytes.
const GROUP: usize = 16 * 48 * 48 * 8;

/// Bytes from which on threads share a pass, as they share an update of the dense inverse.
const PARALLEL_FROM: usize = 8 << 20;

/// A block of numbers to read and write once, from one end to the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stream {
    data: Vec<f64>,
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

    /// Copies half of the first `numbers` numbers onto the other half and back: as many bytes read
    /// and written as [`pass`](Self::pass) does, in the same pieces, by the system's `memcpy`.
    /// Returns them.
    pub fn copy(&mut self, numbers: usize) -> usize {
        let half = numbers.min(self.data.len()) / 2;
        let (low, high) = self.data[..2 * half].split_at_mut(half);
        copy(black_box(low), black_box(high));
        copy(black_box(high), black_box(low));
        black_box(&self.data);
        2 * half * size_of::<f64>()
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

fn copy(source: &[f64], target: &mut [f64]) {
    // The block that both are halves of is what a pass goes over.
    if is_large(2 * source.len()) {
        let size = GROUP / size_of::<f64>();
        let pieces = target.par_chunks_mut(size).zip(source.par_chunks(size));
        pieces.for_each(|(target, source)| target.copy_from_slice(source));
    } else {
        target.copy_from_slice(source);
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
    fn a_pass_changes_exactly_its_numbers_a_large_one_too() {
        let mut stream = Stream::new(5);
        assert_eq!(stream.pass(3), 24);
        assert_eq!(stream.data, [-1.0, -1.0, -1.0, 1.0, 1.0]);
        assert_eq!(stream.pass(9), 40);
        assert_eq!(stream.data, [1.0, 1.0, 1.0, -1.0, -1.0]);
        let mut stream = Stream::new(PARALLEL_FROM / 4 + 3);
        let count = PARALLEL_FROM / 8 + 1;
        assert_eq!(stream.pass(count), 8 * count);
        assert!(stream.data[..count].iter().all(|x| *x == -1.0));
        assert!(stream.data[count..].iter().all(|x| *x == 1.0));
    }

    #[test]
    fn a_copy_goes_over_both_halves_a_large_one_too() {
        let mut stream = Stream { data: vec![1.0, 2.0, 3.0, 4.0, 5.0] };
        assert_eq!(stream.copy(9), 32);
        assert_eq!(stream.data, [1.0, 2.0, 1.0, 2.0, 5.0]);
        let half = PARALLEL_FROM / 16 + 3;
        let mut stream = Stream { data: (0..2 * half + 1).map(|i| i as f64).collect() };
        assert_eq!(stream.copy(2 * half + 1), 16 * half);
        let want = (0..half).chain(0..half).chain(2 * half..2 * half + 1);
        assert!(stream.data.iter().zip(want).all(|(x, want)| *x == want as f64));
    }
}
