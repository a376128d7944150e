//! Points in the cubes of a grid, to find those near a box.

use nalgebra::Vector3;

/// Points that a bin has on average.
const PER_BIN: f64 = 16.0;

/// Cubes become smaller by this factor as long as there are not too many.
const FINER: f64 = 0.8;

/// Numbers of points by the cube that they lie in, of a grid over all of them.
pub(super) struct Bins {
    low: Vector3<f64>,
    /// Edge of a cube, m.
    edge: f64,
    counts: [usize; 3],
    /// Bin b has `numbers[starts[b]..starts[b + 1]]`.
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

impl Bins {
    pub fn new(points: &[Vector3<f64>]) -> Self {
        let none = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        let (low, high) = points.iter().fold(none, |(low, high), x| (low.inf(x), high.sup(x)));
        let size =
            (high - low).map(|length| if length.is_finite() { length.max(0.0) } else { 0.0 });
        // A flat or thin cloud has cubes as wide as its points ask for along the others.
        let wanted = (points.len() as f64 / PER_BIN).max(1.0);
        let mut edge = size.max();
        let bins = |edge: f64| size.map(|length| (length / edge).floor() + 1.0).product();
        while edge > 0.0 && bins(FINER * edge) <= wanted {
            edge *= FINER;
        }
        let counts: [usize; 3] = match edge > 0.0 {
            true => size.map(|length| (length / edge) as usize + 1).into(),
            false => [1; 3],
        };
        let mut bins = Self { low, edge, counts, starts: Vec::new(), numbers: Vec::new() };
        let of: Vec<usize> = points.iter().map(|x| bins.flat(bins.bin(x))).collect();
        let mut starts = vec![0; counts.iter().product::<usize>() + 1];
        of.iter().for_each(|&bin| starts[bin + 1] += 1);
        (1..starts.len()).for_each(|bin| starts[bin] += starts[bin - 1]);
        let mut next = starts.clone();
        bins.numbers = vec![0; points.len()];
        for (number, &bin) in of.iter().enumerate() {
            bins.numbers[next[bin] as usize] = number as u32;
            next[bin] += 1;
        }
        bins.starts = starts;
        bins
    }

    /// The bin of a place, the nearest of one outside.
    fn bin(&self, x: &Vector3<f64>) -> [usize; 3] {
        [0, 1, 2].map(|axis| {
            match self.edge > 0.0 {
                true => ((x[axis] - self.low[axis]) / self.edge) as usize,
                false => 0,
            }
            .min(self.counts[axis] - 1)
        })
    }

    fn flat(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// Numbers of all points of the bins that a box meets.
    pub fn near(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> impl Iterator<Item = usize> {
        let (first, last) = (self.bin(low), self.bin(high));
        let lines =
            (first[2]..=last[2]).flat_map(move |z| (first[1]..=last[1]).map(move |y| (y, z)));
        // The bins of a line along x lie behind each other.
        lines.flat_map(move |(y, z)| {
            let [start, end] =
                [first[0], last[0] + 1].map(|x| self.starts[self.flat([0, y, z]) + x] as usize);
            self.numbers[start..end].iter().map(|&number| number as usize)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(count: usize, size: [f64; 3]) -> Vec<Vector3<f64>> {
        let part = |i: usize| (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        let point = |i: usize| {
            [0, 1, 2].map(|axis| size[axis] * part(3 * i + axis) as f64 / f64::from(1 << 24))
        };
        (0..count).map(|i| Vector3::from(point(i)) - Vector3::new(0.3, 0.0, 7.0)).collect()
    }

    #[test]
    fn every_point_of_a_box_is_near_it_and_hardly_another() {
        let shapes = [[1.0, 2.0, 0.5], [1.0, 0.0, 1.0], [0.0, 3.0, 0.0], [0.0; 3]];
        for (count, shape) in [0, 1, 3, 1000].into_iter().flat_map(|n| shapes.map(|s| (n, s))) {
            let points = cloud(count, shape);
            let bins = Bins::new(&points);
            for corner in cloud(40, [1.2, 2.2, 0.7]) {
                let low = corner.add_scalar(-0.1);
                for high in [low, low.add_scalar(0.2), low.add_scalar(9.0)] {
                    let mut near: Vec<usize> = bins.near(&low, &high).collect();
                    near.sort_unstable();
                    assert!(near.windows(2).all(|pair| pair[0] < pair[1]));
                    for (i, x) in points.iter().enumerate() {
                        let is_in = (0..3).all(|a| low[a] <= x[a] && x[a] <= high[a]);
                        assert!(!is_in || near.binary_search(&i).is_ok(), "{shape:?} {x} {low}");
                    }
                    let small = high == low && count == 1000 && shape[0] > 0.0;
                    assert!(!small || near.len() <= 80, "{shape:?}: {}", near.len());
                }
            }
        }
    }
}
