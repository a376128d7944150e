//! The label tree: what each tetrahedron of the hierarchy holds.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;

use super::cell_grid::CellGrid;
use super::node::{Content, HOMOGENEOUS, NodeRef};
use super::subtree::CellPart;
use crate::bisection::BisectionError;
use crate::bisection::kuhn::ROOTS_PER_CELL;
use crate::image::volume::LabelVolume;

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
    set_numbers: HashMap<Vec<u16>, u32>,
    set_of_node: Vec<u32>,
    majority: Vec<u16>,
    cell_ranges: Vec<std::ops::Range<usize>>,
    /// Where the nodes of a cell may lie: its range, and what an edit has left free behind it.
    cell_ends: Vec<usize>,
    /// Nodes of parts that are no longer in use.
    free_parts: Vec<u32>,
}

impl LabelTree {
    /// Builds the tree of `volume` on `grid`, in parallel over root cubes; deterministic.
    ///
    /// Cost: O(voxels) reads and O(heterogeneous tetrahedra) time and memory.
    ///
    /// # Errors
    /// [`BisectionError::TooManyNodes`] beyond 2³¹ heterogeneous tetrahedra.
    pub fn new(volume: &LabelVolume, grid: CellGrid) -> Result<Self, BisectionError> {
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
    ) -> Result<Self, BisectionError> {
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
            set_numbers: HashMap::new(),
            set_of_node: Vec::new(),
            majority: Vec::new(),
            cell_ranges: vec![0..0; cell_count],
            cell_ends: vec![0; cell_count],
            free_parts: Vec::new(),
        }
    }

    /// The tree of `volume` after some of its voxels have changed, all of them in `cells`, of `varies` as in
    /// [`per_voxel`](Self::per_voxel).
    ///
    /// Nodes of other cells keep their numbers. What no longer fits where a cell's nodes are moves to the end, with
    /// half as much room again: [`node_count`](Self::node_count) counts what that leaves empty. Cost: O(voxels) of
    /// these cells, and a copy of the tree.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn edited(
        &self,
        volume: &LabelVolume,
        cells: &[usize],
        varies: &(dyn Fn(u16) -> bool + Sync),
    ) -> Result<Self, BisectionError> {
        let build = |&cell: &usize| CellPart::build(volume, &self.grid, cell, varies);
        let parts: Vec<CellPart> = cells.par_iter().map(build).collect();
        let mut tree = self.clone();
        for (&cell, part) in cells.iter().zip(parts) {
            let count = part.children.len();
            let mut start = tree.cell_ranges[cell].start;
            if start + count > tree.cell_ends[cell] {
                start = tree.children.len();
                tree.cell_ends[cell] = start + count + count / 2;
                tree.resize(tree.cell_ends[cell])?;
            }
            tree.cell_ranges[cell] = start..start + count;
            tree.put(cell, start, part);
        }
        Ok(tree)
    }

    /// A node for a share of a tetrahedron's material: its finest tetrahedra have these dense labels. It has itself as
    /// both children and belongs to no root cube.
    ///
    /// # Errors
    /// [`BisectionError::TooManyNodes`] beyond 2³¹ nodes.
    pub(crate) fn add_part(
        &mut self,
        labels: impl Iterator<Item = u16>,
    ) -> Result<NodeRef, BisectionError> {
        let mut counts = BTreeMap::new();
        labels.for_each(|label| *counts.entry(label).or_insert(0usize) += 1);
        let index = match self.free_parts.pop() {
            Some(index) => index as usize,
            None => {
                self.resize(self.children.len() + 1)?;
                self.children.len() - 1
            }
        };
        let node = NodeRef::node(index);
        self.children[index] = [node; 2];
        let most = counts.values().max().copied();
        let majority = counts.iter().find(|(_, count)| Some(**count) == most);
        self.majority[index] = majority.map_or(0, |(&label, _)| label);
        self.set_of_node[index] = self.set_number(counts.into_keys().collect());
        Ok(node)
    }

    /// Takes the node of a part out of use.
    pub(crate) fn drop_part(&mut self, node: NodeRef) {
        if let Content::Node(index) = node.open() {
            self.free_parts.push(index as u32);
        }
    }

    /// Room for so many nodes.
    fn resize(&mut self, total: usize) -> Result<(), BisectionError> {
        if total >= HOMOGENEOUS as usize {
            return Err(BisectionError::TooManyNodes { count: total, limit: HOMOGENEOUS as usize });
        }
        self.children.resize(total, [NodeRef::VOID; 2]);
        self.set_of_node.resize(total, 0);
        self.majority.resize(total, 0);
        Ok(())
    }

    /// Enters what is in a cell, its nodes from `start` on.
    fn put(&mut self, cell: usize, start: usize, part: CellPart) {
        let shift = |r: NodeRef| match r.open() {
            Content::Node(i) => NodeRef::node(i + start),
            Content::Label(_) => r,
        };
        let first = cell * ROOTS_PER_CELL;
        self.roots[first..first + ROOTS_PER_CELL].copy_from_slice(&part.roots.map(shift));
        for (i, halves) in part.children.iter().enumerate() {
            self.children[start + i] = halves.map(shift);
        }
        self.majority[start..start + part.majority.len()].copy_from_slice(&part.majority);
        for (i, set) in part.sets.into_iter().enumerate() {
            self.set_of_node[start + i] = self.set_number(set);
        }
    }

    fn set_number(&mut self, set: Vec<u16>) -> u32 {
        let next = self.label_sets.len() as u32;
        *self.set_numbers.entry(set).or_insert_with_key(|set| {
            self.label_sets.push(set.clone());
            next
        })
    }

    fn concatenate(grid: CellGrid, parts: Vec<CellPart>) -> Result<Self, BisectionError> {
        let total: usize = parts.iter().map(|p| p.children.len()).sum();
        let mut tree = Self {
            grid,
            roots: vec![NodeRef::VOID; parts.len() * ROOTS_PER_CELL],
            children: Vec::new(),
            label_sets: Vec::new(),
            set_numbers: HashMap::new(),
            set_of_node: Vec::new(),
            majority: Vec::new(),
            cell_ranges: Vec::with_capacity(parts.len()),
            cell_ends: Vec::with_capacity(parts.len()),
            free_parts: Vec::new(),
        };
        tree.resize(total)?;
        let mut start = 0;
        for (cell, part) in parts.into_iter().enumerate() {
            let end = start + part.children.len();
            tree.cell_ranges.push(start..end);
            tree.cell_ends.push(end);
            tree.put(cell, start, part);
            start = end;
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

    /// Number of heterogeneous tetrahedra, all levels, and of those that an [edit](Self::edited) left empty.
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
