//! The integer lattice of a bisection forest: which vertices exist, and which need which.
//!
//! Root cubes are `units` = N = 2^⌈Lmax/3⌉ lattice units wide. The generation of a vertex (the
//! level of the tetrahedra that its split creates) and the older vertices it depends on follow
//! from the bits of its coordinates alone; the mesh is a set of vertices closed under these
//! dependencies (a diamond hierarchy: Weiss and De Floriani, Computer Graphics Forum 30(8), 2011).

use arrayvec::ArrayVec;

use super::kuhn::Point;

/// Which of three kinds of older vertices a split needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// A corner of a root cube: always there.
    Root,
    /// The centre of a cube: bisects the body diagonal of six TYPE0 tetrahedra.
    CubeCentre,
    /// The centre of a face: bisects the face diagonal of four TYPE1 tetrahedra.
    FaceCentre,
    /// The midpoint of a cube's edge: bisects it in eight TYPE2 tetrahedra.
    EdgeMidpoint,
}

/// The finest level: 64 lattice units per root cube, whose page in a `PointMap` takes 1 MiB.
pub const MAX_LEVEL: u8 = 18;

/// Root cubes and lattice units: sizes only, no state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lattice {
    /// Root cubes along x, y, z.
    pub cells: [usize; 3],
    /// Lattice units per root cube, a power of two.
    pub units: i32,
}

impl Lattice {
    /// The lattice on which tetrahedra down to `max_level` have integer corners.
    pub fn new(cells: [usize; 3], max_level: u8) -> Self {
        Self { cells, units: 1 << max_level.div_ceil(3) }
    }

    /// Coordinates packed 3 × 21 bits, x lowest: a canonical order of vertices.
    pub fn key(p: Point) -> u64 {
        p[0] as u64 | (p[1] as u64) << 21 | (p[2] as u64) << 42
    }

    /// True where `p` lies in the closed box of all root cubes.
    pub fn contains(&self, p: Point) -> bool {
        (0..3).all(|i| p[i] >= 0 && p[i] <= self.cells[i] as i32 * self.units)
    }

    /// The kind of `p` and its spacing s, the lowest set bit of x|y|z.
    pub fn site(&self, p: Point) -> (Site, i32) {
        let bits = p[0] | p[1] | p[2];
        let s = bits & bits.wrapping_neg();
        if s == 0 || s >= self.units {
            return (Site::Root, self.units);
        }
        let site = match p.iter().filter(|&&c| c & s != 0).count() {
            3 => Site::CubeCentre,
            2 => Site::FaceCentre,
            _ => Site::EdgeMidpoint,
        };
        (site, s)
    }

    /// Level of the tetrahedra that the split at `p` creates; 0 for root vertices.
    pub fn generation(&self, p: Point) -> u8 {
        let (site, s) = self.site(p);
        let doublings = (self.units / (2 * s)).trailing_zeros() as u8;
        match site {
            Site::Root => 0,
            Site::CubeCentre => 3 * doublings + 1,
            Site::FaceCentre => 3 * doublings + 2,
            Site::EdgeMidpoint => 3 * doublings + 3,
        }
    }

    /// The older vertices that must be active before `p` may be: 3, 2 or 4, those inside the
    /// lattice's box (the caller drops those outside its domain).
    pub fn dependencies(&self, p: Point) -> ArrayVec<Point, 4> {
        let (site, s) = self.site(p);
        let mut older = ArrayVec::new();
        let mut push = |mut q: Point, axis: usize, step: i32| {
            q[axis] += step;
            if self.contains(q) {
                older.push(q);
            }
        };
        match site {
            Site::CubeCentre if 2 * s < self.units => {
                // The corner ≡ 0 mod 4s of the cube around p: where diagonals start.
                let corner = p.map(|c| (c + s) & !(4 * s - 1));
                for axis in 0..3 {
                    push(corner, axis, if p[axis] > corner[axis] { 2 * s } else { -2 * s });
                }
            }
            Site::Root | Site::CubeCentre => {}
            Site::FaceCentre | Site::EdgeMidpoint => {
                for axis in (0..3).filter(|&i| p[i] & s == 0) {
                    push(p, axis, -s);
                    push(p, axis, s);
                }
            }
        }
        older
    }

    /// The ends of the edge whose midpoint `p` is: `None` for root vertices. They are older.
    ///
    /// Along each odd axis the edge runs from the coordinate ≡ 0 mod 4s to the other one: from
    /// even corners of cubes to odd ones.
    pub fn edge_ends(&self, p: Point) -> Option<[Point; 2]> {
        let (site, s) = self.site(p);
        if site == Site::Root {
            return None;
        }
        let even = p.map(|c| if c & s == 0 { c } else { (c + s) & !(4 * s - 1) });
        Some([even, std::array::from_fn(|i| 2 * p[i] - even[i])])
    }

    /// The root cubes whose closure holds `p` (1, 2, 4 or 8), as linear cell numbers.
    pub fn cells_around(&self, p: Point) -> impl Iterator<Item = usize> + use<> {
        let (cells, units) = (self.cells, self.units);
        let low = p.map(|c| (c - 1).div_euclid(units));
        let high = p.map(|c| c.div_euclid(units));
        (low[2]..=high[2]).flat_map(move |z| {
            (low[1]..=high[1]).flat_map(move |y| {
                (low[0]..=high[0]).filter_map(move |x| {
                    let inside =
                        [x, y, z].iter().zip(cells).all(|(&c, n)| c >= 0 && (c as usize) < n);
                    inside.then(|| x as usize + cells[0] * (y as usize + cells[1] * z as usize))
                })
            })
        })
    }

    /// Coordinates of a linear cell number.
    pub fn cell_coordinates(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells;
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// Linear number of a cell.
    pub fn cell_number(&self, cell: [usize; 3]) -> usize {
        cell[0] + self.cells[0] * (cell[1] + self.cells[1] * cell[2])
    }

    /// Number of root cubes.
    pub fn cell_count(&self) -> usize {
        self.cells.iter().product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generations_follow_the_bits() {
        let lattice = Lattice::new([2, 2, 2], 9);
        assert_eq!(lattice.units, 8);
        let points = [[8, 0, 16], [4, 4, 12], [4, 4, 8], [4, 8, 8], [2, 6, 10], [1, 2, 4]];
        assert_eq!(points.map(|p| lattice.generation(p)), [0, 1, 2, 3, 4, 9]);
    }

    #[test]
    fn dependencies_are_older_and_as_many_as_the_kind_says() {
        let lattice = Lattice::new([3, 3, 3], 9);
        for x in 8..=16 {
            for y in 8..=16 {
                for z in 8..=16 {
                    let p = [x, y, z];
                    let (site, s) = lattice.site(p);
                    let deps = lattice.dependencies(p);
                    let want = match site {
                        Site::Root => 0,
                        Site::CubeCentre if 2 * s == lattice.units => 0,
                        Site::CubeCentre => 3,
                        Site::FaceCentre => 2,
                        Site::EdgeMidpoint => 4,
                    };
                    assert_eq!(deps.len(), want, "{p:?}");
                    for q in deps {
                        assert_eq!(lattice.generation(q) + 1, lattice.generation(p), "{p:?} {q:?}");
                    }
                }
            }
        }
    }
}
