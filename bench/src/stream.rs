//! The memory bound that updates of a dense inverse are measured against.

use std::hint::black_box;

/// A block of numbers to read and write once, from one end to the other.
#[derive(Clone, Debug)]
pub struct Stream {
    data: Vec<f64>,
}

impl Stream {
    /// Room for passes over up to `numbers` numbers; all pages are touched here.
    pub fn new(numbers: usize) -> Self {
        Self { data: vec![1.0; numbers] }
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
}
