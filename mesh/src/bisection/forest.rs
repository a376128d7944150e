//! The bisection forest at run time: a closed set of active vertices, refined and merged one
//! vertex at a time (Oishi et al., section 3.1.2 and their reference [4]).
//!
//! Every lattice point that is a vertex or could become the next one has a *diamond*: the ring
//! of tetrahedra around the edge whose midpoint it is. Splitting and merging touch that ring
//! and at most four counters; nothing is searched.

use std::sync::Arc;

use super::cut::Cuts;
use super::delta::VertexId;
use super::diamond::{Diamond, NONE, SLOTS, TetRecord};
use super::domain::Domain;
use super::kuhn::{Point, ROOTS_PER_CELL, midpoint, root_corners};
use super::label_tree::LabelTree;
use super::lattice::{Lattice, MAX_LEVEL};
use super::point_map::{ABSENT, PointMap};
use super::ring_shape::{RING_SHAPES, RingShapes};
use crate::bisection::BisectionError;

/// Numbers of tetrahedra are 32 bits wide.
const MAX_DIAMONDS: usize = u32::MAX as usize / SLOTS;

#[derive(Clone, Copy, Debug)]
pub(crate) struct VertexRecord {
    pub(crate) point: Point,
    pub(crate) diamond: u32,
    pub(crate) generation: u8,
    pub(crate) alive: bool,
    /// Belongs to the mesh that merging never goes below.
    pub(crate) floor: bool,
}

/// A conforming tetrahedral mesh of a voxel-shaped domain that refines and merges online.
#[derive(Clone, Debug)]
pub struct BisectionForest {
    pub(crate) domain: Domain,
    pub(crate) tree: Arc<LabelTree>,
    pub(crate) shapes: &'static RingShapes,
    pub(crate) start_level: u8,
    pub(crate) max_level: u8,
    pub(crate) vertices: Vec<VertexRecord>,
    pub(crate) free_vertices: Vec<u32>,
    pub(crate) diamonds: Vec<Diamond>,
    pub(crate) free_diamonds: Vec<u32>,
    pub(crate) by_point: PointMap,
    pub(crate) vertex_count: usize,
    pub(crate) leaf_count: usize,
    /// Diamonds with members and no vertex: their members are the leaves.
    pub(crate) open: Vec<u32>,
    /// Splits and merges so far.
    pub(crate) changes: u64,
    pub(crate) cuts: Cuts,
}

impl BisectionForest {
    /// The uniform mesh at `start_level`, which is also the floor of merging.
    ///
    /// `domain` lies on a lattice of at least `max_level`; `tree` has the same cells.
    ///
    /// # Errors
    /// [`BisectionError::Level`] if start_level > max_level or the lattice does not reach max_level;
    /// [`BisectionError::NothingInside`] if the domain is empty.
    pub fn new(
        domain: Domain,
        tree: Arc<LabelTree>,
        start_level: u8,
        max_level: u8,
    ) -> Result<Self, BisectionError> {
        let lattice = *domain.lattice();
        let beyond = |what, level, limit| Err(BisectionError::Level { what, level, limit });
        if max_level > MAX_LEVEL || Lattice::new(lattice.cells, max_level) != lattice {
            return beyond("max_level", max_level, MAX_LEVEL);
        }
        if start_level > max_level {
            return beyond("start_level", start_level, max_level);
        }
        let mut forest = Self {
            by_point: PointMap::over(&domain),
            domain,
            tree,
            shapes: &RING_SHAPES,
            start_level,
            max_level,
            vertices: Vec::new(),
            free_vertices: Vec::new(),
            diamonds: Vec::new(),
            free_diamonds: Vec::new(),
            vertex_count: 0,
            leaf_count: 0,
            open: Vec::new(),
            changes: 0,
            cuts: Cuts::default(),
        };
        forest.plant_roots();
        if forest.leaf_count == 0 {
            return Err(BisectionError::NothingInside);
        }
        forest.refine_uniformly(start_level)?;
        forest.sort_diamonds();
        Ok(forest)
    }

    /// Makes the current mesh the floor of merging: none of its vertices can be merged from now
    /// on, whatever the start level. Cost: O(vertices).
    pub fn make_floor(&mut self) {
        for record in self.vertices.iter_mut().filter(|record| record.alive) {
            record.floor = true;
        }
    }

    fn plant_roots(&mut self) {
        let lattice = *self.domain.lattice();
        let cells: Vec<usize> = self.domain.cells().collect();
        for cell in cells {
            let coordinates = lattice.cell_coordinates(cell);
            let mut home = NONE;
            for order in 0..ROOTS_PER_CELL {
                let corners = root_corners(coordinates, order, lattice.units);
                let vertices = corners.map(|p| self.root_vertex(p));
                if home == NONE {
                    let centre = midpoint(&corners, 0);
                    home = self.new_diamond(centre, self.by_point.find(centre).0, 0);
                }
                let shape = self.shapes.of_root(&corners);
                let slot = usize::from(self.shapes.get(shape).slot);
                let diamond = &mut self.diamonds[home as usize];
                diamond.members |= 1 << slot;
                diamond.tets[slot] = TetRecord {
                    vertices,
                    node: self.tree.root(cell, order),
                    children: [NONE; 2],
                    level: 0,
                    hull: self.domain.root_hull(cell, order),
                    shape,
                };
                self.leaf_count += 1;
            }
        }
    }

    fn root_vertex(&mut self, p: Point) -> VertexId {
        let known = self.by_point.get(p);
        if known != ABSENT {
            return VertexId(self.diamonds[known as usize].vertex);
        }
        let place = self.by_point.find(p).0;
        let diamond = self.take_diamond(p, place, 0);
        self.by_point.set_at(place, diamond);
        self.new_vertex(p, 0, diamond)
    }

    pub(crate) fn new_vertex(&mut self, point: Point, generation: u8, diamond: u32) -> VertexId {
        let record = VertexRecord { point, diamond, generation, alive: true, floor: false };
        let id = match self.free_vertices.pop() {
            Some(id) => {
                self.vertices[id as usize] = record;
                id
            }
            None => {
                self.vertices.push(record);
                self.vertices.len() as u32 - 1
            }
        };
        self.diamonds[diamond as usize].vertex = id;
        self.vertex_count += 1;
        VertexId(id)
    }

    /// An open diamond for tetrahedra of `level`, whose point has this place in the map of
    /// points; those of the finest level have neither.
    pub(crate) fn new_diamond(&mut self, point: Point, place: usize, level: u8) -> u32 {
        let id = self.take_diamond(point, place, level);
        if level < self.max_level {
            self.by_point.set_at(place, id);
        }
        self.open_diamond(id);
        id
    }

    pub(crate) fn take_diamond(&mut self, point: Point, place: usize, level: u8) -> u32 {
        if let Some(id) = self.free_diamonds.pop() {
            self.diamonds[id as usize].renew(point, place, level);
            return id;
        }
        assert!(self.diamonds.len() < MAX_DIAMONDS, "more tetrahedra than 32-bit numbers");
        self.diamonds.push(Diamond::new(point, place, level));
        self.diamonds.len() as u32 - 1
    }

    /// Takes an empty diamond out of use.
    pub(crate) fn drop_diamond(&mut self, id: u32) {
        self.close_diamond(id);
        let diamond = &self.diamonds[id as usize];
        if diamond.level < self.max_level {
            self.by_point.set_at(diamond.place, ABSENT);
        }
        self.free_diamonds.push(id);
    }

    #[inline]
    pub(crate) fn open_diamond(&mut self, id: u32) {
        self.diamonds[id as usize].open_at = self.open.len() as u32;
        self.open.push(id);
    }

    #[inline]
    pub(crate) fn close_diamond(&mut self, id: u32) {
        let at = std::mem::replace(&mut self.diamonds[id as usize].open_at, NONE);
        self.open.swap_remove(at as usize);
        if let Some(&moved) = self.open.get(at as usize) {
            self.diamonds[moved as usize].open_at = at;
        }
    }

    pub(crate) fn by_point_checked(&self, p: Point) -> u32 {
        if self.domain.lattice().contains(p) { self.by_point.get(p) } else { ABSENT }
    }
}
