//! One vertex in, one vertex out: the two steps that all changes of a forest are made of.

use super::delta::{Change, MeshDelta, RingTet, Tet, VertexId};
use super::diamond::{NONE, SLOTS, TetRecord, occupied, tet_number, tet_place};
use super::forest::BisectionForest;
use super::kuhn::{Point, bisect, bisected_corner, unite};
use super::point_map::ABSENT;
use super::ring_shape::DIRECTIONS;
use crate::bisection::BisectionError;

/// Older vertices of a diamond inside a domain, by TYPE of its members.
const MAKERS: [usize; 3] = [3, 2, 4];

/// The vertex that comes in while its ring is bisected.
struct Arrival {
    vertex: VertexId,
    point: Point,
    level: u8,
    diamond: u32,
    /// Lattice spacing of the vertices that depend on it.
    spacing: i32,
    /// The diamonds that take the halves in, by direction (or in twos at the finest level).
    homes: [u32; SLOTS],
    /// Where the map of points keeps them.
    places: [usize; SLOTS],
}

impl BisectionForest {
    /// Activates the vertex at `p` by bisecting its ring; fills `delta`.
    ///
    /// Cost: O(1), the ring of at most 8 tetrahedra; no allocation while the mesh stays within
    /// the largest size it has had and `delta.ring` has room for 8.
    ///
    /// # Errors
    /// [`BisectionError::NotSplittable`] if `p` is active, no leaf above `max_level` has it as its
    /// midpoint, or an older vertex that it depends on is missing (see [`Self::closure`]).
    pub fn split(&mut self, p: Point, delta: &mut MeshDelta) -> Result<VertexId, BisectionError> {
        let id = self.by_point_checked(p);
        if id == ABSENT || !self.is_splittable(id) {
            return Err(BisectionError::NotSplittable { point: p });
        }
        // All that may miss the caches is asked for before anything waits for it.
        let mut arrival = self.arrival(p, id);
        let members = self.diamonds[id as usize].members;
        self.count_dependents(id, 1);
        self.close_diamond(id);
        arrival.vertex = self.new_vertex(p, arrival.level + 1, id);
        delta.ring.clear();
        for slot in occupied(members) {
            let ring_tet = self.bisect_tet(slot, &mut arrival);
            delta.ring.push(ring_tet);
        }
        self.leaf_count += delta.ring.len();
        self.changes += 1;
        finish(Change::Split, arrival.vertex, delta);
        Ok(arrival.vertex)
    }

    /// True where a split may happen now.
    pub(crate) fn is_splittable(&self, id: u32) -> bool {
        let diamond = &self.diamonds[id as usize];
        diamond.vertex == NONE
            && diamond.members != 0
            && !self.is_cut(id)
            && (diamond.makers() == MAKERS[usize::from(diamond.level % 3)]
                || self.missing(diamond.point).next().is_none())
    }

    fn arrival(&self, point: Point, diamond: u32) -> Arrival {
        let lattice = self.domain.lattice();
        let level = lattice.generation(point) - 1;
        let spacing = (lattice.units / 2) >> ((level + 1) / 3);
        let (mut homes, mut places) = ([NONE; SLOTS], [0; SLOTS]);
        if level + 1 < self.max_level {
            // From the place alone, so that no look-up waits for the ring's memory. Towards its
            // dependencies and outside the domain a point has no dependents: those go unused.
            for (way, step) in DIRECTIONS[usize::from(level % 3)].iter().enumerate() {
                let next = [0, 1, 2].map(|i| point[i] + spacing * step[i]);
                if lattice.contains(next) {
                    (places[way], homes[way]) = self.by_point.find(next);
                }
            }
        }
        Arrival { vertex: VertexId(NONE), point, level, diamond, spacing, homes, places }
    }

    /// Bisects one tetrahedron of the ring.
    #[inline]
    fn bisect_tet(&mut self, slot: usize, arrival: &mut Arrival) -> RingTet {
        let parent = self.diamonds[arrival.diamond as usize].tets[slot];
        let shape = *self.shapes.get(parent.shape);
        let [first, second] = bisect(&parent.vertices, arrival.level, arrival.vertex);
        let nodes = self.tree.children(parent.node);
        let hulls = self.shapes.bisect_hull(parent.hull, arrival.level);
        let child = |side: usize, vertices| TetRecord {
            vertices,
            node: nodes[side],
            children: [NONE; 2],
            level: arrival.level + 1,
            hull: hulls[side],
            shape: shape.children[side],
        };
        let (first, second) = (child(0, first), child(1, second));
        let ways = if arrival.level + 1 == self.max_level {
            [(slot / 4, slot % 4 * 2), (slot / 4, slot % 4 * 2 + 1)]
        } else {
            let at = |side: usize| usize::from(self.shapes.get(shape.children[side]).slot);
            [(usize::from(shape.towards[0]), at(0)), (usize::from(shape.towards[1]), at(1))]
        };
        let one = self.settle(&first, ways[0], arrival);
        let two = self.settle(&second, ways[1], arrival);
        self.diamonds[arrival.diamond as usize].tets[slot].children = [one, two];
        self.cuts.split(tet_number(arrival.diamond, slot), [one, two]);
        RingTet {
            parent: parent.tet(tet_number(arrival.diamond, slot)),
            children: [first.tet(one), second.tet(two)],
        }
    }

    /// Puts a half where it belongs, given as direction and slot; returns its number.
    #[inline]
    fn settle(
        &mut self,
        half: &TetRecord,
        (way, slot): (usize, usize),
        arrival: &mut Arrival,
    ) -> u32 {
        if arrival.homes[way] == NONE {
            let step = DIRECTIONS[usize::from(arrival.level % 3)][way];
            let point = [0, 1, 2].map(|i| arrival.point[i] + arrival.spacing * step[i]);
            arrival.homes[way] = self.new_diamond(point, arrival.places[way], half.level);
        }
        let home = arrival.homes[way];
        let diamond = &mut self.diamonds[home as usize];
        diamond.members |= 1 << slot;
        diamond.dependencies[usize::from(self.shapes.get(half.shape).dependency)] = arrival.diamond;
        diamond.tets[slot] = *half;
        tet_number(home, slot)
    }

    fn count_dependents(&mut self, id: u32, step: i8) {
        for older in self.diamonds[id as usize].dependencies {
            if older != NONE {
                let counter = &mut self.diamonds[older as usize].active_dependents;
                *counter = counter.wrapping_add_signed(step);
            }
        }
    }

    /// Takes `vertex` out again; fills `delta` with the ring as it was.
    ///
    /// Cost: O(1), the ring of at most 8 tetrahedra; no allocation while `delta.ring` has room
    /// for 8 and the lists of free numbers for those that become free.
    ///
    /// # Errors
    /// [`BisectionError::NotMergeable`] if it is not active, belongs to the start mesh, or a younger
    /// vertex depends on it.
    pub fn merge(&mut self, vertex: VertexId, delta: &mut MeshDelta) -> Result<(), BisectionError> {
        if !self.is_mergeable(vertex) {
            return Err(BisectionError::NotMergeable { vertex: vertex.0 });
        }
        let id = self.vertices[vertex.index()].diamond;
        delta.ring.clear();
        for slot in occupied(self.diamonds[id as usize].members) {
            let TetRecord { children: [one, two], level, .. } =
                self.diamonds[id as usize].tets[slot];
            let children = [self.take_out(one), self.take_out(two)];
            self.cuts.merge(tet_number(id, slot), [one, two]);
            let parent = &mut self.diamonds[id as usize].tets[slot];
            // A cut may have given its corners other vertices since it was split.
            parent.vertices = unite(&children.map(|child| child.vertices), level);
            let parent = *parent;
            delta.ring.push(RingTet { parent: parent.tet(tet_number(id, slot)), children });
        }
        self.count_dependents(id, -1);
        self.diamonds[id as usize].vertex = NONE;
        self.open_diamond(id);
        self.vertices[vertex.index()].alive = false;
        self.free_vertices.push(vertex.0);
        self.vertex_count -= 1;
        self.leaf_count -= delta.ring.len();
        self.changes += 1;
        finish(Change::Merge, vertex, delta);
        Ok(())
    }

    /// Takes one leaf out of its diamond.
    #[inline]
    fn take_out(&mut self, number: u32) -> Tet {
        let (home, slot) = tet_place(number);
        let diamond = &mut self.diamonds[home];
        let record = &diamond.tets[slot];
        let tet = record.tet(number);
        diamond.dependencies[usize::from(self.shapes.get(record.shape).dependency)] = NONE;
        diamond.members &= !(1 << slot);
        if diamond.members == 0 {
            self.drop_diamond(home as u32);
        }
        tet
    }
}

fn finish(change: Change, vertex: VertexId, delta: &mut MeshDelta) {
    delta.change = change;
    delta.vertex = vertex;
    let parent = &delta.ring[0].parent;
    delta.edge = [parent.vertices[0], parent.vertices[bisected_corner(parent.level)]];
    delta.edge.sort_unstable();
}
