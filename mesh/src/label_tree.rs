//! What is inside each tetrahedron of the hierarchy: labels, bottom-up and exact.
//!
//! The tree bisects root cubes down to `embed_level`, where one TYPE0 cube is one voxel. A
//! subtree of one label is a single number, so memory follows the label boundaries and not the
//! volume. Voxels are never sampled at tetrahedron centroids above that level (they lie on the
//! tetrahedra's planes): labels only move up by union. Labels whose voxels are not all alike keep
//! a node per finest tetrahedron.

use std::collections::HashMap;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::error::MeshError;
use crate::geometry::Placement;
use crate::kuhn::{Point, ROOTS_PER_CELL, bisect, midpoint, root_corners};
use crate::lattice::Lattice;
use crate::volume::LabelVolume;

/// A tetrahedron's content: one label throughout, or a heterogeneous node of a [`LabelTree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct NodeRef(u32);

/// A [`NodeRef`], opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// The whole tetrahedron has this dense label.
    Label(u16),
    /// The node of this index has two children that differ, or is a finest tetrahedron whose
    /// material is its own ([`LabelTree::per_voxel`]).
    Node(usize),
}

const HOMOGENEOUS: u32 = 1 << 31;

impl NodeRef {
    /// A tetrahedron of background.
    pub(crate) const VOID: Self = Self(HOMOGENEOUS);

    /// A tetrahedron of one dense label.
    pub fn label(label: u16) -> Self {
        Self(HOMOGENEOUS | u32::from(label))
    }

    /// A heterogeneous tetrahedron.
    fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// What it is.
    pub fn open(self) -> Content {
        if self.0 & HOMOGENEOUS != 0 {
            Content::Label((self.0 & 0xffff) as u16)
        } else {
            Content::Node(self.0 as usize)
        }
    }
}

/// How root cubes lie on the voxels of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellGrid {
    /// Root cubes along x, y, z.
    pub cells: [usize; 3],
    /// Voxels along a root cube's edge, 2^k.
    pub voxels_per_cell: usize,
    /// Voxel at the corner of the first cube; may be negative (outside is void).
    pub first_voxel: [i64; 3],
}

impl CellGrid {
    /// The smallest grid of cubes of `voxels_per_cell` (a power of two) that covers the
    /// non-void voxels of `volume`, centred on them.
    ///
    /// # Errors
    /// [`MeshError::NothingInside`] if all voxels are background.
    pub fn around(volume: &LabelVolume, voxels_per_cell: usize) -> Result<Self, MeshError> {
        let [low, high] = volume.bounding_box().ok_or(MeshError::NothingInside)?;
        let mut cells = [0; 3];
        let mut first_voxel = [0; 3];
        for axis in 0..3 {
            let extent = high[axis] + 1 - low[axis];
            cells[axis] = extent.div_ceil(voxels_per_cell);
            let slack = (cells[axis] * voxels_per_cell - extent) as i64;
            first_voxel[axis] = low[axis] as i64 - slack / 2;
        }
        Ok(Self { cells, voxels_per_cell, first_voxel })
    }

    /// Where a lattice on these cubes lies, for voxels of edge `voxel_m` (m), the first of them at
    /// the origin.
    pub fn placement(&self, voxel_m: f64, lattice: &Lattice) -> Placement {
        Placement {
            origin: Vector3::from(self.first_voxel.map(|v| v as f64 * voxel_m)),
            unit: self.voxels_per_cell as f64 * voxel_m / f64::from(lattice.units),
        }
    }

    /// The level at which one TYPE0 cube is one voxel: 3k for cubes of 2^k voxels.
    pub fn embed_level(&self) -> u8 {
        3 * self.voxels_per_cell.trailing_zeros() as u8
    }
}

/// Label content of all tetrahedra of a forest down to voxel size.
///
/// Nodes are numbered cell by cell, children before parents, so that a bottom-up pass over one
/// cell touches one contiguous range.
#[derive(Clone, Debug)]
pub struct LabelTree {
    grid: CellGrid,
    roots: Vec<NodeRef>,
    children: Vec<[NodeRef; 2]>,
    label_sets: Vec<Vec<u16>>,
    set_of_node: Vec<u32>,
    majority: Vec<u16>,
    cell_ranges: Vec<std::ops::Range<usize>>,
}

impl LabelTree {
    /// Builds the tree of `volume` on `grid`, in parallel over root cubes; deterministic.
    ///
    /// Cost: O(voxels) reads and O(heterogeneous tetrahedra) time and memory.
    ///
    /// # Errors
    /// [`MeshError::TooManyNodes`] beyond 2³¹ heterogeneous tetrahedra.
    pub fn new(volume: &LabelVolume, grid: CellGrid) -> Result<Self, MeshError> {
        Self::per_voxel(volume, grid, &|_| false)
    }

    /// As [`new`](Self::new), with one node per finest tetrahedron of every dense label that
    /// `varies`: each of its voxels may have a material of its own.
    ///
    /// Such a node has itself as both children. Cost: at least 6 nodes per such voxel, and as many
    /// again above them.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn per_voxel(
        volume: &LabelVolume,
        grid: CellGrid,
        varies: &(dyn Fn(u16) -> bool + Sync),
    ) -> Result<Self, MeshError> {
        let cell_count: usize = grid.cells.iter().product();
        let parts: Vec<CellPart> = (0..cell_count)
            .into_par_iter()
            .map(|cell| CellPart::build(volume, &grid, cell, varies))
            .collect();
        Self::concatenate(grid, parts)
    }

    /// A tree in which every root tetrahedron has the one dense label.
    pub fn homogeneous(cells: [usize; 3], label: u16) -> Self {
        let cell_count: usize = cells.iter().product();
        Self {
            grid: CellGrid { cells, voxels_per_cell: 1, first_voxel: [0; 3] },
            roots: vec![NodeRef::label(label); cell_count * ROOTS_PER_CELL],
            children: Vec::new(),
            label_sets: Vec::new(),
            set_of_node: Vec::new(),
            majority: Vec::new(),
            cell_ranges: vec![0..0; cell_count],
        }
    }

    fn concatenate(grid: CellGrid, parts: Vec<CellPart>) -> Result<Self, MeshError> {
        let total: usize = parts.iter().map(|p| p.children.len()).sum();
        if total >= HOMOGENEOUS as usize {
            return Err(MeshError::TooManyNodes { count: total, limit: HOMOGENEOUS as usize });
        }
        let mut tree = Self {
            grid,
            roots: Vec::with_capacity(parts.len() * ROOTS_PER_CELL),
            children: Vec::with_capacity(total),
            label_sets: Vec::new(),
            set_of_node: Vec::with_capacity(total),
            majority: Vec::with_capacity(total),
            cell_ranges: Vec::with_capacity(parts.len()),
        };
        let mut set_numbers: HashMap<Vec<u16>, u32> = HashMap::new();
        for part in parts {
            let offset = tree.children.len();
            let shift = |r: NodeRef| match r.open() {
                Content::Node(i) => NodeRef::node(i + offset),
                Content::Label(_) => r,
            };
            tree.roots.extend(part.roots.map(shift));
            tree.children.extend(part.children.iter().map(|c| c.map(shift)));
            tree.majority.extend(&part.majority);
            for set in part.sets {
                let next = tree.label_sets.len() as u32;
                let number = *set_numbers.entry(set).or_insert_with_key(|set| {
                    tree.label_sets.push(set.clone());
                    next
                });
                tree.set_of_node.push(number);
            }
            tree.cell_ranges.push(offset..tree.children.len());
        }
        Ok(tree)
    }

    /// How the root cubes lie on the voxels.
    pub fn grid(&self) -> &CellGrid {
        &self.grid
    }

    /// Content of root tetrahedron `order` (0..6) of linear cell `cell`.
    pub fn root(&self, cell: usize, order: usize) -> NodeRef {
        self.roots[cell * ROOTS_PER_CELL + order]
    }

    /// Number of heterogeneous tetrahedra, all levels.
    pub fn node_count(&self) -> usize {
        self.children.len()
    }

    /// The nodes of one cell, children before parents.
    pub fn cell_nodes(&self, cell: usize) -> std::ops::Range<usize> {
        self.cell_ranges[cell].clone()
    }

    /// Contents of the two halves; those of a homogeneous or finest tetrahedron are its own.
    pub fn children(&self, of: NodeRef) -> [NodeRef; 2] {
        match of.open() {
            Content::Node(i) => self.children[i],
            Content::Label(_) => [of, of],
        }
    }

    /// All dense labels inside, ascending.
    pub fn labels(&self, of: NodeRef) -> LabelsIn<'_> {
        match of.open() {
            Content::Node(i) => {
                LabelsIn::Set(self.label_sets[self.set_of_node[i] as usize].as_slice())
            }
            Content::Label(label) => LabelsIn::One([label]),
        }
    }

    /// The dense label with the largest volume inside (the smallest such label in a tie).
    pub fn majority(&self, of: NodeRef) -> u16 {
        match of.open() {
            Content::Node(i) => self.majority[i],
            Content::Label(label) => label,
        }
    }

    /// True where a root cube holds anything but background.
    pub fn cell_is_solid(&self, cell: usize) -> bool {
        (0..ROOTS_PER_CELL).any(|order| self.root(cell, order) != NodeRef::label(0))
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.roots.len() * 4 + self.children.len() * (8 + 4 + 2)
    }
}

/// The labels inside a tetrahedron.
#[derive(Clone, Copy, Debug)]
pub enum LabelsIn<'a> {
    /// A single label.
    One([u16; 1]),
    /// Several, ascending.
    Set(&'a [u16]),
}

impl LabelsIn<'_> {
    /// The labels as a slice, ascending.
    pub fn as_slice(&self) -> &[u16] {
        match self {
            Self::One(one) => one,
            Self::Set(set) => set,
        }
    }
}

/// The subtree of one root cube, numbered from zero.
struct CellPart {
    roots: [NodeRef; ROOTS_PER_CELL],
    children: Vec<[NodeRef; 2]>,
    sets: Vec<Vec<u16>>,
    majority: Vec<u16>,
}

/// Volume by label in units of one finest tetrahedron, ascending labels.
type Counts = Vec<(u16, u64)>;

impl CellPart {
    fn build(
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
        let [nx, ny, _] = grid.cells;
        let coordinates = [cell % nx, cell / nx % ny, cell / (nx * ny)];
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
        let [nx, ny, _] = grid.cells;
        let cell = [cell % nx, cell / nx % ny, cell / (nx * ny)];
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
