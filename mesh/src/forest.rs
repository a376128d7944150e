//! The bisection forest at run time: a closed set of active vertices, refined and merged one
//! vertex at a time (Oishi et al., section 3.1.2 and their reference [4]).
//!
//! Every lattice point that is a vertex or could become the next one has a *diamond*: the ring
//! of tetrahedra around the edge whose midpoint it is. Splitting and merging touch that ring
//! and at most four counters; nothing is searched.

use std::sync::Arc;

use crate::delta::{Change, MeshDelta, RingTet, Tet, TetId, VertexId};
use crate::domain::Domain;
use crate::error::MeshError;
use crate::kuhn::{
    Point, ROOTS_PER_CELL, bisect, bisect_hull, bisected_corner, midpoint, root_corners,
};
use crate::label_tree::{LabelTree, NodeRef};
use crate::lattice::{ABSENT, Lattice, MAX_LEVEL, PointMap};

pub(crate) const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
pub(crate) struct VertexRecord {
    pub(crate) point: Point,
    pub(crate) generation: u8,
    pub(crate) active_dependents: u8,
    pub(crate) diamond: u32,
    pub(crate) alive: bool,
    /// Belongs to the mesh that merging never goes below.
    pub(crate) floor: bool,
}

/// The ring around an edge, known by the edge's midpoint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Diamond {
    pub(crate) ring: [u32; 8],
    pub(crate) len: u8,
    pub(crate) vertex: u32,
    pub(crate) point: Point,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct TetRecord {
    pub(crate) vertices: [VertexId; 4],
    pub(crate) node: NodeRef,
    pub(crate) level: u8,
    /// Bit i: the face opposite corner i lies on the domain's hull.
    pub(crate) hull: u8,
    /// Position in the list of leaves, or NONE.
    pub(crate) leaf_at: u32,
    /// First of two children, or NONE for a leaf.
    pub(crate) child: u32,
    pub(crate) diamond: u32,
    /// Root number and the path of child choices: a name that does not depend on history.
    pub(crate) root: u32,
    pub(crate) path: u64,
}

/// A conforming tetrahedral mesh of a voxel-shaped domain that refines and merges online.
#[derive(Clone, Debug)]
pub struct BisectionForest {
    pub(crate) domain: Domain,
    pub(crate) tree: Arc<LabelTree>,
    pub(crate) start_level: u8,
    pub(crate) max_level: u8,
    pub(crate) vertices: Vec<VertexRecord>,
    pub(crate) free_vertices: Vec<u32>,
    pub(crate) tets: Vec<TetRecord>,
    pub(crate) free_pairs: Vec<u32>,
    pub(crate) diamonds: Vec<Diamond>,
    pub(crate) free_diamonds: Vec<u32>,
    pub(crate) by_point: PointMap,
    pub(crate) vertex_count: usize,
    pub(crate) leaves: Vec<u32>,
}

impl BisectionForest {
    /// The uniform mesh at `start_level`, which is also the floor of merging.
    ///
    /// `domain` lies on a lattice of at least `max_level`; `tree` has the same cells.
    ///
    /// # Errors
    /// [`MeshError::Level`] if start_level > max_level or the lattice does not reach max_level;
    /// [`MeshError::NothingInside`] if the domain is empty.
    pub fn new(
        domain: Domain,
        tree: Arc<LabelTree>,
        start_level: u8,
        max_level: u8,
    ) -> Result<Self, MeshError> {
        let lattice = *domain.lattice();
        if max_level > MAX_LEVEL || Lattice::new(lattice.cells, max_level) != lattice {
            return Err(MeshError::Level { what: "max_level", level: max_level, limit: MAX_LEVEL });
        }
        if start_level > max_level {
            let what = "start_level";
            return Err(MeshError::Level { what, level: start_level, limit: max_level });
        }
        let mut forest = Self {
            by_point: PointMap::new(&lattice),
            domain,
            tree,
            start_level,
            max_level,
            vertices: Vec::new(),
            free_vertices: Vec::new(),
            tets: Vec::new(),
            free_pairs: Vec::new(),
            diamonds: Vec::new(),
            free_diamonds: Vec::new(),
            vertex_count: 0,
            leaves: Vec::new(),
        };
        forest.plant_roots();
        if forest.leaves.is_empty() {
            return Err(MeshError::NothingInside);
        }
        forest.refine_uniformly(start_level)?;
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
            for order in 0..ROOTS_PER_CELL {
                let corners = root_corners(coordinates, order, lattice.units);
                let vertices = corners.map(|p| self.root_vertex(p));
                let root = (cell * ROOTS_PER_CELL + order) as u32;
                self.tets.push(TetRecord {
                    vertices,
                    node: self.tree.root(cell, order),
                    level: 0,
                    hull: self.domain.root_hull(cell, order),
                    leaf_at: self.leaves.len() as u32,
                    child: NONE,
                    diamond: NONE,
                    root,
                    path: 1,
                });
                self.leaves.push(self.tets.len() as u32 - 1);
                self.join_diamond(self.tets.len() - 1);
            }
        }
    }

    fn root_vertex(&mut self, p: Point) -> VertexId {
        let known = self.by_point.get(p);
        if known != ABSENT {
            return VertexId(self.diamonds[known as usize].vertex);
        }
        let diamond = self.new_diamond(p);
        self.new_vertex(p, 0, diamond)
    }

    fn new_vertex(&mut self, point: Point, generation: u8, diamond: u32) -> VertexId {
        let record = VertexRecord {
            point,
            generation,
            active_dependents: 0,
            diamond,
            alive: true,
            floor: false,
        };
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

    fn new_diamond(&mut self, point: Point) -> u32 {
        let diamond = Diamond { ring: [NONE; 8], len: 0, vertex: NONE, point };
        let id = match self.free_diamonds.pop() {
            Some(id) => {
                self.diamonds[id as usize] = diamond;
                id
            }
            None => {
                self.diamonds.push(diamond);
                self.diamonds.len() as u32 - 1
            }
        };
        self.by_point.set(point, id);
        id
    }

    fn join_diamond(&mut self, tet: usize) {
        let record = self.tets[tet];
        if record.level >= self.max_level {
            return;
        }
        let corners = record.vertices.map(|v| self.vertices[v.index()].point);
        let point = midpoint(&corners, record.level);
        let id = match self.by_point.get(point) {
            ABSENT => self.new_diamond(point),
            known => known,
        };
        let diamond = &mut self.diamonds[id as usize];
        diamond.ring[usize::from(diamond.len)] = tet as u32;
        diamond.len += 1;
        self.tets[tet].diamond = id;
    }

    fn leave_diamond(&mut self, tet: usize) {
        let id = self.tets[tet].diamond;
        if id == NONE {
            return;
        }
        let diamond = &mut self.diamonds[id as usize];
        let len = usize::from(diamond.len);
        if let Some(at) = diamond.ring[..len].iter().position(|&t| t == tet as u32) {
            diamond.ring.copy_within(at + 1..len, at);
            diamond.len -= 1;
        }
        if diamond.len == 0 && diamond.vertex == NONE {
            self.by_point.set(diamond.point, ABSENT);
            self.free_diamonds.push(id);
        }
    }

    /// Activates the vertex at `p` by bisecting its ring; fills `delta`.
    ///
    /// Cost: O(1), the ring of at most 8 tetrahedra.
    ///
    /// # Errors
    /// [`MeshError::NotSplittable`] if `p` is active, no leaf above `max_level` has it as its
    /// midpoint, or an older vertex that it depends on is missing (see [`Self::closure`]).
    pub fn split(&mut self, p: Point, delta: &mut MeshDelta) -> Result<VertexId, MeshError> {
        let id = self.by_point_checked(p);
        if id == ABSENT || self.diamonds[id as usize].vertex != NONE || !self.is_ready(p) {
            return Err(MeshError::NotSplittable { point: p });
        }
        let generation = self.domain.lattice().generation(p);
        let vertex = self.new_vertex(p, generation, id);
        for i in 0..usize::from(self.diamonds[id as usize].len) {
            let parent = self.diamonds[id as usize].ring[i] as usize;
            self.bisect_tet(parent, vertex);
        }
        self.count_dependents(p, 1);
        self.describe(Change::Split, vertex, id, delta);
        Ok(vertex)
    }

    fn bisect_tet(&mut self, parent: usize, midpoint: VertexId) {
        let record = self.tets[parent];
        let halves = bisect(&record.vertices, record.level, midpoint);
        let nodes = self.tree.children(record.node);
        let hulls = bisect_hull(record.hull, record.level);
        let first = match self.free_pairs.pop() {
            Some(first) => first as usize,
            None => {
                let first = self.tets.len();
                self.tets.extend([record; 2]);
                first
            }
        };
        for side in 0..2 {
            self.tets[first + side] = TetRecord {
                vertices: halves[side],
                node: nodes[side],
                level: record.level + 1,
                hull: hulls[side],
                leaf_at: if side == 0 { record.leaf_at } else { self.leaves.len() as u32 },
                child: NONE,
                diamond: NONE,
                root: record.root,
                path: record.path << 1 | side as u64,
            };
            self.join_diamond(first + side);
        }
        self.leaves[record.leaf_at as usize] = first as u32;
        self.leaves.push(first as u32 + 1);
        self.tets[parent].child = first as u32;
        self.tets[parent].leaf_at = NONE;
    }

    fn count_dependents(&mut self, p: Point, step: i8) {
        for &q in self.domain.lattice().dependencies(p).as_slice() {
            if let Some(v) = self.vertex_at(q) {
                let counter = &mut self.vertices[v.index()].active_dependents;
                *counter = counter.wrapping_add_signed(step);
            }
        }
    }

    /// Takes `vertex` out again; fills `delta` with the ring as it was.
    ///
    /// Cost: O(1), the ring of at most 8 tetrahedra.
    ///
    /// # Errors
    /// [`MeshError::NotMergeable`] if it is not active, belongs to the start mesh, or a younger
    /// vertex depends on it.
    pub fn merge(&mut self, vertex: VertexId, delta: &mut MeshDelta) -> Result<(), MeshError> {
        if !self.is_mergeable(vertex) {
            return Err(MeshError::NotMergeable { vertex: vertex.0 });
        }
        let VertexRecord { point, diamond, .. } = self.vertices[vertex.index()];
        self.describe(Change::Merge, vertex, diamond, delta);
        for i in 0..usize::from(self.diamonds[diamond as usize].len) {
            let parent = self.diamonds[diamond as usize].ring[i] as usize;
            let first = self.tets[parent].child as usize;
            self.leave_diamond(first);
            self.leave_diamond(first + 1);
            self.join_leaves(parent, first);
            self.free_pairs.push(first as u32);
            self.tets[parent].child = NONE;
        }
        self.diamonds[diamond as usize].vertex = NONE;
        self.count_dependents(point, -1);
        self.vertices[vertex.index()].alive = false;
        self.free_vertices.push(vertex.0);
        self.vertex_count -= 1;
        Ok(())
    }

    /// The list of leaves gets `parent` for its two children, whose first is `first`.
    fn join_leaves(&mut self, parent: usize, first: usize) {
        let [at, other] = [first, first + 1].map(|t| self.tets[t].leaf_at);
        self.leaves[at as usize] = parent as u32;
        self.tets[parent].leaf_at = at;
        self.leaves.swap_remove(other as usize);
        if let Some(&moved) = self.leaves.get(other as usize) {
            self.tets[moved as usize].leaf_at = other;
        }
        for child in [first, first + 1] {
            self.tets[child].leaf_at = NONE;
        }
    }

    fn describe(&self, change: Change, vertex: VertexId, diamond: u32, delta: &mut MeshDelta) {
        delta.change = change;
        delta.vertex = vertex;
        self.ring_of(diamond, &mut delta.ring, |first| {
            [self.tet_at(first as usize), self.tet_at(first as usize + 1)]
        });
        let parent = &delta.ring[0].parent;
        delta.edge = [parent.vertices[0], parent.vertices[bisected_corner(parent.level)]];
        delta.edge.sort_unstable();
    }

    /// Fills `ring` with the tetrahedra of a diamond in the order of their names.
    fn ring_of(&self, diamond: u32, ring: &mut Vec<RingTet>, children: impl Fn(u32) -> [Tet; 2]) {
        let Diamond { ring: mut members, len, .. } = self.diamonds[diamond as usize];
        let members = &mut members[..usize::from(len)];
        members.sort_unstable_by_key(|&t| {
            let record = &self.tets[t as usize];
            (record.root, record.path)
        });
        ring.clear();
        ring.extend(members.iter().map(|&t| RingTet {
            parent: self.tet_at(t as usize),
            children: children(self.tets[t as usize].child),
        }));
    }

    pub(crate) fn by_point_checked(&self, p: Point) -> u32 {
        if self.domain.lattice().contains(p) { self.by_point.get(p) } else { ABSENT }
    }

    pub(crate) fn tet_at(&self, index: usize) -> Tet {
        let record = &self.tets[index];
        Tet {
            id: TetId(index as u32),
            vertices: record.vertices,
            level: record.level,
            node: record.node,
        }
    }
}
