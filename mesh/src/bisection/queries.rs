//! Questions to a bisection forest.

use std::sync::Arc;

use super::delta::{Tet, TetId, VertexId};
use super::diamond::{Diamond, NONE, SLOTS, TetRecord, occupied, tet_number, tet_place};
use super::domain::Domain;
use super::forest::{BisectionForest, VertexRecord};
use super::geometry::FACES;
use super::kuhn::{Point, bisect, bisected_corner, unite};
use super::label_tree::LabelTree;
use super::lattice::Lattice;
use super::point_map::ABSENT;

impl BisectionForest {
    /// True where every older vertex that `p` depends on is active.
    pub fn is_ready(&self, p: Point) -> bool {
        self.missing(p).next().is_none()
    }

    /// The direct dependencies of `p` that are inside the domain and not active.
    pub(crate) fn missing(&self, p: Point) -> impl Iterator<Item = Point> + '_ {
        let dependencies = self.domain.lattice().dependencies(p).into_iter();
        dependencies.filter(|&q| self.vertex_at(q).is_none() && self.domain.contains(q))
    }

    /// True where `vertex` may be merged: active, above the start mesh and not of the floor that
    /// [`Self::make_floor`] set, without dependents.
    pub fn is_mergeable(&self, vertex: VertexId) -> bool {
        self.vertices.get(vertex.index()).is_some_and(|record| {
            record.alive
                && !record.floor
                && record.generation > self.start_level
                && self.diamonds[record.diamond as usize].active_dependents == 0
                && !self.holds_cut(record.diamond)
        })
    }

    /// Whether a cut keeps the halves of a diamond's members from becoming one: it has made several of a vertex that they
    /// share, or is in one of them.
    fn holds_cut(&self, id: u32) -> bool {
        let Diamond { members, tets, level, vertex, .. } = &self.diamonds[id as usize];
        if self.cuts.are_none() {
            return false;
        }
        let mut edge = None;
        occupied(*members).any(|slot| {
            let halves = tets[slot].children;
            let vertices = halves.map(|half| self.record(TetId(half)).vertices);
            let whole = unite(&vertices, *level);
            halves.iter().any(|&half| self.cuts.freezes(half))
                || bisect(&whole, *level, VertexId(*vertex)) != vertices
                || *edge.get_or_insert(ends(whole, *level)) != ends(whole, *level)
        })
    }

    /// Whether a cut keeps the members of a diamond from being split: it is in one of them, or has made several of a vertex of their
    /// edge.
    pub(crate) fn is_cut(&self, id: u32) -> bool {
        let Diamond { members, tets, level, .. } = &self.diamonds[id as usize];
        let mut edge = None;
        !self.cuts.are_none()
            && occupied(*members).any(|slot| {
                let of_tet = ends(tets[slot].vertices, *level);
                self.cuts.freezes(tet_number(id, slot)) || *edge.get_or_insert(of_tet) != of_tet
            })
    }

    /// The active vertex at a lattice point; where a cut has made several, that of all splits and merges.
    pub fn vertex_at(&self, p: Point) -> Option<VertexId> {
        let id = self.by_point_checked(p);
        (id != ABSENT)
            .then(|| self.diamonds[id as usize].vertex)
            .filter(|&v| v != NONE)
            .map(VertexId)
    }

    /// The domain.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The labels inside.
    pub fn tree(&self) -> &Arc<LabelTree> {
        &self.tree
    }

    /// The uniform level that merging never goes below.
    pub fn start_level(&self) -> u8 {
        self.start_level
    }

    /// The finest level that splits reach.
    pub fn max_level(&self) -> u8 {
        self.max_level
    }

    /// Number of active vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Number of leaf tetrahedra.
    pub fn leaf_count(&self) -> usize {
        self.leaf_count
    }

    /// One more than the largest vertex number ever in use: the length of arrays by vertex.
    pub fn vertex_capacity(&self) -> usize {
        self.vertices.len()
    }

    /// One more than the largest tetrahedron number ever in use.
    pub fn tet_capacity(&self) -> usize {
        self.diamonds.len() * SLOTS
    }

    /// Bytes held, without the label tree.
    pub fn bytes(&self) -> usize {
        self.vertices.capacity() * size_of::<VertexRecord>()
            + self.diamonds.capacity() * size_of::<Diamond>()
            + self.by_point.bytes()
            + 4 * (self.free_vertices.capacity()
                + self.free_diamonds.capacity()
                + self.open.capacity())
    }

    /// Active vertices, ascending numbers.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        (0..self.vertices.len()).filter(|&i| self.vertices[i].alive).map(|i| VertexId(i as u32))
    }

    /// Leaf tetrahedra, all sheets of those that are cut: the current mesh, in an order that depends on its history.
    pub fn leaves(&self) -> impl Iterator<Item = Tet> + '_ {
        let sheets = self.cuts.sheets().map(|(number, sheet)| sheet.record.tet(number));
        self.open_members().chain(sheets)
    }

    /// A tetrahedron of the forest by its number.
    ///
    /// # Panics
    /// If the number was never in use.
    pub fn tet(&self, id: TetId) -> Tet {
        self.record(id).tet(id.0)
    }

    /// Leaf tetrahedra without the sheets beyond each one's own.
    pub(crate) fn open_members(&self) -> impl Iterator<Item = Tet> + '_ {
        self.open.iter().flat_map(|&id| self.members(id))
    }

    /// The faces of leaves that lie on the domain's hull, corners ascending, in the order of
    /// the leaves. Cost: O(leaves); which faces these are is kept with every split and merge.
    pub fn boundary_faces(&self) -> Vec<[VertexId; 3]> {
        let mut faces = Vec::new();
        for leaf in self.leaves() {
            let record = self.record(leaf.id);
            for opposite in (0..4).filter(|i| record.hull & (1 << i) != 0) {
                let mut face = FACES[opposite].map(|i| record.vertices[i]);
                face.sort_unstable();
                faces.push(face);
            }
        }
        faces
    }

    /// Lattice point of an active vertex.
    pub fn point(&self, vertex: VertexId) -> Point {
        self.vertices[vertex.index()].point
    }

    /// Generation of an active vertex.
    pub fn generation(&self, vertex: VertexId) -> u8 {
        self.vertices[vertex.index()].generation
    }

    /// The point whose activation would bisect `tet`; none at the finest level and where it is cut.
    pub fn refinement_point(&self, tet: TetId) -> Option<Point> {
        let id = tet_place(tet.0).0;
        let diamond = &self.diamonds[id];
        let is_cut = || self.cuts.marks(tet.0) && self.is_cut(id as u32);
        (diamond.level < self.max_level && !is_cut()).then_some(diamond.point)
    }

    /// Fills `ring` with what a split at `p` would bisect, if it may happen now; the children
    /// are given with the number of their parent. Returns false otherwise.
    pub fn split_ring(&self, p: Point, ring: &mut Vec<Tet>) -> bool {
        if !self.is_candidate(p) {
            return false;
        }
        let id = self.by_point.get(p);
        self.parents_of(id, ring);
        true
    }

    /// Fills `ring` with the coarse tetrahedra that a merge of `vertex` would restore, if it may
    /// happen now. Returns false otherwise.
    pub fn merge_ring(&self, vertex: VertexId, ring: &mut Vec<Tet>) -> bool {
        if !self.is_mergeable(vertex) {
            return false;
        }
        self.parents_of(self.vertices[vertex.index()].diamond, ring);
        true
    }

    /// Fills `ring` with the coarse tetrahedra that an active vertex bisects, finer vertices or
    /// not; none for a root vertex.
    pub fn ring_of(&self, vertex: VertexId, ring: &mut Vec<Tet>) {
        self.parents_of(self.vertices[vertex.index()].diamond, ring);
    }

    /// Fills `ring` with the members of a diamond, in the order of their slots.
    fn parents_of(&self, id: u32, ring: &mut Vec<Tet>) {
        ring.clear();
        ring.extend(self.members(id));
    }

    fn members(&self, id: u32) -> impl Iterator<Item = Tet> + '_ {
        let Diamond { members, tets, .. } = &self.diamonds[id as usize];
        occupied(*members).map(move |slot| tets[slot].tet(tet_number(id, slot)))
    }

    pub(crate) fn record(&self, tet: TetId) -> &TetRecord {
        if let Some(sheet) = self.cuts.sheet(tet.0) {
            return &sheet.record;
        }
        let (diamond, slot) = tet_place(tet.0);
        &self.diamonds[diamond].tets[slot]
    }

    /// True where a split may happen now.
    pub(crate) fn is_candidate(&self, p: Point) -> bool {
        let id = self.by_point_checked(p);
        id != ABSENT && self.is_splittable(id)
    }

    /// Points at which a split may happen now, ascending keys.
    pub fn candidates(&self) -> Vec<Point> {
        let mut points: Vec<Point> = self
            .open
            .iter()
            .filter(|&&id| self.diamonds[id as usize].level < self.max_level)
            .filter(|&&id| self.is_splittable(id))
            .map(|&id| self.diamonds[id as usize].point)
            .collect();
        points.sort_unstable_by_key(|&p| Lattice::key(p));
        points
    }
}

/// The ends of the edge that is bisected in a tetrahedron of a level.
fn ends(vertices: [VertexId; 4], level: u8) -> [VertexId; 2] {
    let mut ends = [vertices[0], vertices[bisected_corner(level)]];
    ends.sort_unstable();
    ends
}
