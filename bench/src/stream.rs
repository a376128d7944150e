//! The memory bound that updates of a dense inverse are measured against.

use std::hint::black_box;

/// A block of numbers to read and write once, from one end to the other.
#[derive(Clone, Debug, Default)]
pub struct Stream {
    data: Vec<f64>,
}

impl Stream {
    /// Room for passes over up to `numbers` numbers; all pages are touched here.
    pub fn new(numbers: usize) -> Self {
        Self { data: vec![1.0; numbers] }
    }

    /// True without room for any pass.
    pub fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    /// Reads, changes and writes the first `numbers` numbers (or all, if there are fewer), in one
    /// thread. Returns the bytes that it went over, each read and written once.
    pub fn pass(&mut self, numbers: usize) -> usize {
        let count = numbers.min(self.data.len());
        let factor = black_box(-1.0);
        for x in &mut self.data[..count] {
            *x *= factor;
        }
        black_box(&self.data);
        count * size_of::<f64>()
    }

    /// Copies half of the first `numbers` numbers onto the other half and back: as many bytes read
    /// and written as [`pass`](Self::pass) does, by the system's `memcpy`. Returns them.
    pub fn copy(&mut self, numbers: usize) -> usize {
        let half = numbers.min(self.data.len()) / 2;
        let (low, high) = self.data[..2 * half].split_at_mut(half);
        black_box(&mut *high).copy_from_slice(black_box(low));
        black_box(&mut *low).copy_from_slice(black_box(high));
        black_box(&self.data);
        2 * half * size_of::<f64>()
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
    }

    #[test]
    fn a_copy_goes_over_both_halves() {
        let mut stream = Stream { data: vec![1.0, 2.0, 3.0, 4.0, 5.0] };
        assert_eq!(stream.copy(9), 32);
        assert_eq!(stream.data, [1.0, 2.0, 1.0, 2.0, 5.0]);
    }
}
