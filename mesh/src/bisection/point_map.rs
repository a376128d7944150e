//! A map from lattice points to numbers, as fast as an array.

use super::domain::Domain;
use super::kuhn::Point;
use super::lattice::Lattice;

/// A map from lattice points to `u32` without hashing: one page of memory per root cube.
#[derive(Clone, Debug)]
pub struct PointMap {
    /// Number of each root cube's page, or [`ABSENT`].
    pages: Vec<u32>,
    page_counts: [usize; 3],
    shift: u32,
    values: Vec<u32>,
}

/// The value of a point that is not in a [`PointMap`].
pub const ABSENT: u32 = u32::MAX;

impl PointMap {
    /// An empty map over `lattice`; a page comes with the first value on it.
    pub fn new(lattice: &Lattice) -> Self {
        let page_counts = lattice.cells.map(|n| n + 1);
        Self {
            pages: vec![ABSENT; page_counts.iter().product()],
            page_counts,
            shift: lattice.units.trailing_zeros(),
            values: Vec::new(),
        }
    }

    /// An empty map with the pages of all points of a body, so that setting them allocates
    /// nothing.
    pub fn over(domain: &Domain) -> Self {
        let lattice = domain.lattice();
        let mut map = Self::new(lattice);
        let mut corners: Vec<[usize; 3]> = Vec::new();
        for cell in domain.cells() {
            let low = lattice.cell_coordinates(cell);
            corners.extend((0..8).map(|c| [0, 1, 2].map(|axis| low[axis] + (c >> axis & 1))));
        }
        corners.sort_by_cached_key(|corner| z_order(corner.map(|c| c as i32)));
        let mut count = 0;
        for corner in corners {
            let page = map.page(corner);
            if map.pages[page] == ABSENT {
                map.pages[page] = count;
                count += 1;
            }
        }
        map.values = vec![ABSENT; (count as usize) << (3 * map.shift)];
        map
    }

    fn page(&self, [x, y, z]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.page_counts;
        x + nx * (y + ny * z)
    }

    /// Place of `p` in the list of pages and on its page.
    #[inline]
    fn address(&self, p: Point) -> (usize, usize) {
        let mask = (1i32 << self.shift) - 1;
        let local = |axis: usize| (p[axis] & mask) as usize;
        let page = |axis: usize| (p[axis] >> self.shift) as usize;
        (
            self.page([page(0), page(1), page(2)]),
            local(0) | local(1) << self.shift | local(2) << (2 * self.shift),
        )
    }

    /// Where `p` is kept, and the value there; (usize::MAX, [`ABSENT`]) off all pages.
    #[inline]
    pub(crate) fn find(&self, p: Point) -> (usize, u32) {
        let (page, local) = self.address(p);
        match self.pages[page] {
            ABSENT => (usize::MAX, ABSENT),
            number => {
                let place = (number as usize) << (3 * self.shift) | local;
                (place, self.values[place])
            }
        }
    }

    /// Sets the value at a place that [`Self::find`] gave.
    #[inline]
    pub(crate) fn set_at(&mut self, place: usize, value: u32) {
        self.values[place] = value;
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        4 * (self.pages.capacity() + self.values.capacity())
    }

    /// The value at `p`, or [`ABSENT`].
    #[inline]
    pub fn get(&self, p: Point) -> u32 {
        self.find(p).1
    }

    /// Sets the value at `p`; [`ABSENT`] removes it.
    pub fn set(&mut self, p: Point, value: u32) {
        let (page, local) = self.address(p);
        if self.pages[page] == ABSENT {
            let size = 1 << (3 * self.shift);
            self.pages[page] = (self.values.len() / size) as u32;
            self.values.resize(self.values.len() + size, ABSENT);
        }
        self.values[(self.pages[page] as usize) << (3 * self.shift) | local] = value;
    }
}

/// The bits of three coordinates interleaved, x lowest: the Z-order of points (G. M. Morton,
/// IBM technical report, 1966). Coordinates of up to 21 bits, not negative.
pub(crate) fn z_order(p: Point) -> u64 {
    // Each step halves the groups of bits and leaves twice as many zeros between them.
    let spread = |c: i32| {
        let mut x = c as u64 & 0x1f_ffff;
        x = (x | x << 32) & 0x001f_0000_0000_ffff;
        x = (x | x << 16) & 0x001f_0000_ff00_00ff;
        x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
        x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
        (x | x << 2) & 0x1249_2492_4924_9249
    };
    spread(p[0]) | spread(p[1]) << 1 | spread(p[2]) << 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn point_map_holds_what_was_set() {
        let lattice = Lattice::new([2, 1, 1], 3);
        let mut map = PointMap::new(&lattice);
        map.set([4, 2, 2], 7);
        map.set([3, 1, 0], 9);
        assert_eq!((map.get([4, 2, 2]), map.get([3, 1, 0]), map.get([0, 0, 0])), (7, 9, ABSENT));
        map.set([3, 1, 0], ABSENT);
        assert_eq!(map.get([3, 1, 0]), ABSENT);
    }

    #[test]
    fn z_order_interleaves_bits() {
        assert_eq!(z_order([0b11, 0, 0]), 0b001_001);
        assert_eq!(z_order([0, 0b101, 0]), 0b010_000_010);
        assert_eq!(z_order([1, 1, 0b10]), 0b100_011);
        assert_eq!(z_order([0x1f_ffff; 3]), (1 << 63) - 1);
        assert_eq!(z_order([1 << 20, 0, 0]), 1 << 60);
    }
}
