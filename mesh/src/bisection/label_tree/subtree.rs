//! The part of a label tree in one root cube, built from its voxels.

use super::cell_grid::CellGrid;
use super::node::NodeRef;
use crate::bisection::kuhn::{Point, ROOTS_PER_CELL, bisect, midpoint, root_corners};
use crate::image::volume::LabelVolume;

/// The subtree of one root cube, numbered from zero.
pub(super) struct CellPart {
    pub(super) roots: [NodeRef; ROOTS_PER_CELL],
    pub(super) children: Vec<[NodeRef; 2]>,
    pub(super) sets: Vec<Vec<u16>>,
    pub(super) majority: Vec<u16>,
}

/// Volume by label in units of one finest tetrahedron, ascending labels.
type Counts = Vec<(u16, u64)>;

impl CellPart {
    pub(super) fn build(
        volume: &LabelVolume,
        grid: &CellGrid,
        cell: usize,
        varies: &dyn Fn(u16) -> bool,
    ) -> Self {
        let pyramid = Pyramid::new(volume, grid, cell);
        let mut part = Self {
            roots: [NodeRef::label(0); ROOTS_PER_CELL],
            children: Vec::new(),
            sets: Vec::new(),
            majority: Vec::new(),
        };
        let coordinates = grid.cell_coordinates(cell);
        let units = grid.voxels_per_cell as i32;
        let corner = coordinates.map(|c| c as i32 * units);
        for order in 0..ROOTS_PER_CELL {
            let corners = root_corners(coordinates, order, units)
                .map(|p| std::array::from_fn(|i| p[i] - corner[i]));
            part.roots[order] = part.descend(&pyramid, varies, &corners, 0).0;
        }
        part
    }

    /// Content and label volumes of a tetrahedron with cell-local corners.
    fn descend(
        &mut self,
        pyramid: &Pyramid,
        varies: &dyn Fn(u16) -> bool,
        corners: &[Point; 4],
        level: u8,
    ) -> (NodeRef, Counts) {
        if level.is_multiple_of(3) {
            let scale = pyramid.levels - u32::from(level / 3);
            if let Some(label) = pyramid.uniform_label(corners, scale) {
                let counts = vec![(label, 1 << (3 * scale))];
                if !varies(label) {
                    return (NodeRef::label(label), counts);
                }
                if scale == 0 {
                    let itself = NodeRef::node(self.children.len());
                    return (self.push([itself; 2], &counts), counts);
                }
            }
        }
        let halves = bisect(corners, level, midpoint(corners, level));
        let (first, counts0) = self.descend(pyramid, varies, &halves[0], level + 1);
        let (second, counts1) = self.descend(pyramid, varies, &halves[1], level + 1);
        let counts = add_counts(&counts0, &counts1);
        if first == second && counts.len() == 1 {
            return (first, counts);
        }
        (self.push([first, second], &counts), counts)
    }

    fn push(&mut self, children: [NodeRef; 2], counts: &Counts) -> NodeRef {
        let index = self.children.len();
        self.children.push(children);
        self.sets.push(counts.iter().map(|&(label, _)| label).collect());
        let largest = counts.iter().map(|&(_, n)| n).max().unwrap_or(0);
        self.majority.push(counts.iter().find(|&&(_, n)| n == largest).map_or(0, |&(l, _)| l));
        NodeRef::node(index)
    }
}

fn add_counts(a: &Counts, b: &Counts) -> Counts {
    let mut sum = a.clone();
    for &(label, n) in b {
        match sum.binary_search_by_key(&label, |&(l, _)| l) {
            Ok(i) => sum[i].1 += n,
            Err(i) => sum.insert(i, (label, n)),
        }
    }
    sum
}

/// Which cubes of one root cube have a single label: level j has cubes of 2^j voxels.
struct Pyramid {
    levels: u32,
    /// Level j: (label, is uniform), x fastest.
    cubes: Vec<Vec<Option<u16>>>,
}

impl Pyramid {
    fn new(volume: &LabelVolume, grid: &CellGrid, cell: usize) -> Self {
        let n = grid.voxels_per_cell;
        let levels = n.trailing_zeros();
        let cell = grid.cell_coordinates(cell);
        let origin: [i64; 3] = std::array::from_fn(|i| grid.first_voxel[i] + (cell[i] * n) as i64);
        let dims = volume.grid().dims;
        let label_at = |local: [usize; 3]| {
            let v: [i64; 3] = std::array::from_fn(|i| origin[i] + local[i] as i64);
            let inside = (0..3).all(|i| v[i] >= 0 && v[i] < dims[i] as i64);
            if inside { volume.get(v[0] as usize, v[1] as usize, v[2] as usize) } else { 0 }
        };
        let mut finest = Vec::with_capacity(n * n * n);
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    finest.push(Some(label_at([x, y, z])));
                }
            }
        }
        let mut cubes = vec![finest];
        for level in 1..=levels {
            let (below, m) = (&cubes[level as usize - 1], n >> level);
            let at = |x: usize, y: usize, z: usize| below[x + 2 * m * (y + 2 * m * z)];
            let mut here = Vec::with_capacity(m * m * m);
            for z in 0..m {
                for y in 0..m {
                    for x in 0..m {
                        let first = at(2 * x, 2 * y, 2 * z);
                        let same = (1..8).all(|c| {
                            at(2 * x + (c & 1), 2 * y + (c >> 1 & 1), 2 * z + (c >> 2)) == first
                        });
                        here.push(if same { first } else { None });
                    }
                }
            }
            cubes.push(here);
        }
        Self { levels, cubes }
    }

    /// The label of the cube of 2^scale voxels around a TYPE0 tetrahedron, if it has but one.
    fn uniform_label(&self, corners: &[Point; 4], scale: u32) -> Option<u16> {
        let m = 1usize << (self.levels - scale);
        let cube: [usize; 3] = std::array::from_fn(|i| {
            let low = corners.iter().map(|c| c[i]).min().unwrap_or(0);
            (low >> scale) as usize
        });
        self.cubes[scale as usize][cube[0] + m * (cube[1] + m * cube[2])]
    }
}
