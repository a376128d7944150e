//! Random splits and merges of an organ, as changes of its stiffness matrix.

use faer::Mat;
use nalgebra::Vector3;
use yawara::inverse::{Assembly, SlotMap};
use yawara_embed::{ElementFormulation, Embedding, LinearTet, P1, RingStiffness};
use yawara_inverse_update::{InverseMaintainer, RingChange, SparseStiffness};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{BisectionForest, Change, Lattice, MeshDelta, Placement, Point, Tet, VertexId};

use crate::bodies::organ::{Organ, elements_of};
use crate::error::{BenchError, Result};
use crate::workloads::random::SplitMix64;

/// One vertex in or out, ready for any maintainer.
#[derive(Clone, Debug)]
pub struct Update {
    /// In or out.
    pub kind: Change,
    /// The slot that it takes or leaves.
    pub slot: usize,
    /// Where the vertex is.
    pub point: Point,
    /// The hand-over; its slots are those before a split and before a merge.
    pub ring: RingChange,
}

impl Update {
    /// Rank of the change on the old vertices: that of A22 and the columns of F and N.
    pub fn rank(&self) -> usize {
        let RingChange { a22, positive, negative, .. } = &self.ring;
        a22.nrows() + positive.ncols() + negative.ncols()
    }

    /// Hands the update to a maintainer.
    /// # Errors
    /// [`BenchError::Inverse`] if it refuses; [`BenchError::WrongSlot`] if it breaks the
    /// contract on slots.
    pub fn apply(&self, maintainer: &mut dyn InverseMaintainer) -> Result<()> {
        match self.kind {
            Change::Merge => {
                maintainer.merge(self.slot, &self.ring)?;
            }
            Change::Split => {
                let (got, want) = (maintainer.split(&self.ring)?, self.slot);
                if got != want {
                    return Err(BenchError::WrongSlot(maintainer.name(), got, want));
                }
            }
        }
        Ok(())
    }
}

/// An organ that refines and merges at random places, with the slots of its free vertices.
///
/// Edges between two fixed vertices are never bisected: their midpoint would be fixed and no
/// split in the sense of the inverse.
pub struct History {
    forest: BisectionForest,
    placement: Placement,
    embedding: Embedding,
    slots: SlotMap,
    /// The number of free vertices stays between these while [`step`](Self::step) chooses.
    least: usize,
    most: usize,
    random: SplitMix64,
    delta: MeshDelta,
    ring: Vec<Tet>,
}

impl History {
    /// Begins at the organ's start mesh; at most `growth` vertices come in on top of it.
    /// # Errors
    /// [`BenchError::Embed`] from the homogenisation.
    pub fn new(organ: &Organ, homogenisation: &str, growth: usize, seed: u64) -> Result<Self> {
        let slots = SlotMap::new(organ.free_vertices());
        Ok(Self {
            forest: organ.forest.clone(),
            placement: organ.placement,
            embedding: organ.embedding(homogenisation)?,
            least: slots.len(),
            most: slots.len() + growth,
            slots,
            random: SplitMix64(seed),
            delta: MeshDelta::empty(),
            ring: Vec::new(),
        })
    }

    /// Refines the organ's start mesh, coarsest rings first and in random order among equals, until
    /// it has exactly `vertices` free vertices; from there [`step`](Self::step) goes `wander` up or
    /// down. The mesh depends on the seed, not on the homogenisation.
    /// # Errors
    /// [`BenchError::TooFewVertices`] if the start mesh has more; [`BenchError::NoRing`] if its
    /// finest level has fewer; [`BenchError::Embed`] from the homogenisation.
    pub fn refined(
        organ: &Organ,
        homogenisation: &str,
        vertices: usize,
        wander: usize,
        seed: u64,
    ) -> Result<Self> {
        let mut history = Self::new(organ, homogenisation, 0, seed)?;
        let start = history.slots.len();
        if vertices < start {
            return Err(BenchError::TooFewVertices(vertices, start));
        }
        while history.slots.len() < vertices {
            history.refine_coarsest(vertices)?;
        }
        history.least = start.max(vertices.saturating_sub(wander));
        history.most = vertices + wander;
        Ok(history)
    }

    /// Splits the rings of the lowest generation, up to `vertices` free vertices.
    fn refine_coarsest(&mut self, vertices: usize) -> Result<()> {
        let mut points = self.candidates();
        let generation = |p: Point| self.forest.domain().lattice().generation(p);
        let lowest = points.iter().map(|&p| generation(p)).min().ok_or_else(|| self.no_ring())?;
        points.retain(|&p| generation(p) == lowest);
        for at in (1..points.len()).rev() {
            points.swap(at, self.random.below(at + 1));
        }
        for point in points {
            if self.slots.len() == vertices {
                break;
            }
            // A neighbour's split may have changed the ring meanwhile.
            if self.forest.split_ring(point, &mut self.ring) {
                let vertex = self.forest.split(point, &mut self.delta)?;
                self.slots.push(vertex);
            }
        }
        Ok(())
    }

    /// The slots of the free vertices as they are now.
    pub fn slots(&self) -> &SlotMap {
        &self.slots
    }

    /// The stiffness of the present mesh on its free vertices, assembled from its elements.
    /// # Errors
    /// [`BenchError::Inverse`] if an element's stiffness is not finite.
    pub fn stiffness(&self) -> Result<SparseStiffness> {
        let is_fixed = |v| self.slots.get(v).is_none();
        let order_key = |v| Lattice::key(self.forest.point(v));
        let elements = elements_of(&self.forest, &self.placement, &self.embedding);
        Ok(Assembly::new(&P1, &is_fixed, &order_key).assemble(elements, &self.slots)?)
    }

    /// Splits or merges at a random place, as likely one as the other where both are possible.
    /// # Errors
    /// [`BenchError::NoRing`] if neither is possible.
    pub fn step(&mut self) -> Result<Update> {
        let free = self.slots.len();
        let merging = free > self.least && (free >= self.most || self.random.below(2) == 0);
        if merging { self.merge() } else { self.split() }
    }

    /// Splits a random ring.
    /// # Errors
    /// As [`step`](Self::step).
    pub fn split(&mut self) -> Result<Update> {
        let candidates = self.candidates();
        let pick = self.random.below(candidates.len());
        self.split_at(*candidates.get(pick).ok_or_else(|| self.no_ring())?)
    }

    /// Splits a random ring and merges it again.
    pub(crate) fn split_and_merge(&mut self) -> Result<[Update; 2]> {
        let split = self.split()?;
        let merge = self.merge_at(split.point)?;
        Ok([split, merge])
    }

    /// Doubles a random free vertex, the tetrahedra on one side of a random plane through it getting the twin, and
    /// makes it one again. The mesh stays as it is.
    pub(crate) fn double_and_join(&mut self) -> Result<[Update; 2]> {
        loop {
            let vertex = self.slots.vertices()[self.random.below(self.slots.len())];
            let (point, normal) = (self.forest.point(vertex), self.random.direction());
            let at = self.placement.position(point);
            let star = self.forest.leaves().filter(|tet| tet.vertices.contains(&vertex));
            let star: Vec<Tet> = star.collect();
            let moved = star.iter().filter(|tet| {
                let corners = tet.vertices.map(|v| self.placement.position(self.forest.point(v)));
                (corners.iter().sum::<Vector3<f64>>() * 0.25 - at).dot(&normal) > 0.0
            });
            let moved: Vec<([VertexId; 4], Mat<f64>)> = moved
                .map(|tet| {
                    let corners =
                        tet.vertices.map(|v| self.placement.position(self.forest.point(v)));
                    let elasticity = self.embedding.elasticity(tet.node);
                    (tet.vertices, P1.stiffness(&LinearTet::new(&corners), &elasticity))
                })
                .collect();
            if moved.is_empty() || moved.len() == star.len() {
                continue;
            }
            let ring = RingStiffness::doubled(3, vertex, &moved);
            let ring = self.slots.ring_change(ring, Lattice::key(point));
            let slot = self.slots.len();
            let double = Update { kind: Change::Split, slot, point, ring };
            return Ok([double.clone(), Update { kind: Change::Merge, ..double }]);
        }
    }

    /// True if there is a vertex that [`merge`](Self::merge) can take out.
    pub(crate) fn can_merge(&self) -> bool {
        self.forest.vertices().any(|v| self.forest.is_mergeable(v))
    }

    /// Splits the ring at `point`; an error if there is none.
    pub(crate) fn split_at(&mut self, point: Point) -> Result<Update> {
        let vertex = self.forest.split(point, &mut self.delta)?;
        let ring = self.hand_over();
        let slot = self.slots.push(vertex);
        Ok(Update { kind: Change::Split, slot, point, ring })
    }

    /// Merges a random vertex that a split brought in.
    pub(crate) fn merge(&mut self) -> Result<Update> {
        let young: Vec<VertexId> =
            self.forest.vertices().filter(|&v| self.forest.is_mergeable(v)).collect();
        let vertex = young.get(self.random.below(young.len())).ok_or_else(|| self.no_ring())?;
        self.merge_at(self.forest.point(*vertex))
    }

    /// Merges the vertex at `point`; an error if there is none that a split brought in, or its ring
    /// has been refined.
    pub(crate) fn merge_at(&mut self, point: Point) -> Result<Update> {
        let vertex = self.forest.vertex_at(point).ok_or_else(|| self.no_ring())?;
        let slot = self.slots.get(vertex).ok_or_else(|| self.no_ring())?;
        self.forest.merge(vertex, &mut self.delta)?;
        let ring = self.hand_over();
        self.slots.swap_remove(vertex);
        Ok(Update { kind: Change::Merge, slot, point, ring })
    }

    fn no_ring(&self) -> BenchError {
        BenchError::NoRing(self.forest.vertex_count())
    }

    /// Points to split at whose new vertex would be free.
    fn candidates(&mut self) -> Vec<Point> {
        let mut points = self.forest.candidates();
        points.retain(|&p| {
            self.forest.split_ring(p, &mut self.ring) && {
                let tet = &self.ring[0];
                let ends = [tet.vertices[0], tet.vertices[bisected_corner(tet.level)]];
                ends.iter().any(|&v| self.slots.get(v).is_some())
            }
        });
        points
    }

    /// The ring of the last split or merge on the vertices that have slots.
    fn hand_over(&self) -> RingChange {
        let position = |v: VertexId| self.placement.position(self.forest.point(v));
        let ring = P1.ring(&self.delta, &self.embedding, &position);
        self.slots.ring_change(ring, Lattice::key(self.forest.point(self.delta.vertex)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::organ::Size;

    /// Largest |a − b| over √(K_ii K_jj).
    fn difference(a: &SparseStiffness, b: &SparseStiffness) -> f64 {
        let (x, y) = (a.to_dense(), b.to_dense());
        let mut worst: f64 = 0.0;
        for i in 0..x.nrows() {
            for j in 0..x.nrows() {
                let scale = (b.diagonal(i) * b.diagonal(j)).sqrt();
                let error = (x[(i, j)] - y[(i, j)]).abs() / scale;
                worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
            }
        }
        worst
    }

    #[test]
    fn updates_add_up_to_the_assembled_stiffness() {
        let organ = Organ::new(Size::Quick).unwrap();
        for homogenisation in ["linear", "laminate"] {
            let mut history = History::new(&organ, homogenisation, 20, 3).unwrap();
            let mut stiffness = history.stiffness().unwrap();
            let (mut splits, mut rank) = (0, 0);
            for _ in 0..120 {
                let update = history.step().unwrap();
                rank = rank.max(update.rank());
                if update.kind == Change::Split {
                    assert_eq!(stiffness.split(&update.ring).unwrap(), update.slot);
                    splits += 1;
                } else {
                    stiffness.merge(update.slot, &update.ring).unwrap();
                }
            }
            assert!((51..80).contains(&splits), "{splits} splits, {} merges", 120 - splits);
            assert!(history.forest.vertex_count() <= organ.forest.vertex_count() + 20);
            // 120 updates with some ten terms each, at E ratios of 1e5 between neighbours.
            let error = difference(&stiffness, &history.stiffness().unwrap());
            assert!(error < 1e5 * 1200.0 * f64::EPSILON, "{homogenisation}: {error:e}");
            match homogenisation {
                "linear" => assert_eq!(rank, 3),
                _ => assert!(rank > 3 && rank <= 21, "{rank}"),
            }
        }
    }

    #[test]
    fn a_mesh_is_refined_to_the_exact_size_and_stays_near_it() {
        let organ = Organ::new(Size::Quick).unwrap();
        let free = organ.free_vertices().count();
        let histories = ["linear", "laminate"]
            .map(|family| History::refined(&organ, family, free + 77, 5, 4).unwrap());
        let [linear, laminate] = histories.each_ref().map(|h| h.slots().vertices());
        assert_eq!(linear.len(), free + 77);
        assert_eq!(linear, laminate);
        let [mut history, _] = histories;
        let mut walk = || history.step().map(|_| history.slots().len());
        let sizes: Vec<usize> = (0..60).map(|_| walk().unwrap()).collect();
        assert!(sizes.iter().all(|n| n.abs_diff(free + 77) <= 5), "{sizes:?}");
        assert!(sizes.iter().min() < sizes.iter().max());
        let error = History::refined(&organ, "linear", free - 1, 5, 4).err().unwrap();
        assert!(matches!(error, BenchError::TooFewVertices(..)), "{error}");
    }

    #[test]
    fn a_split_and_its_merge_at_a_point_restore_the_slots() {
        let organ = Organ::new(Size::Quick).unwrap();
        let mut history = History::refined(&organ, "linear", 200, 5, 4).unwrap();
        let before = history.slots().vertices().to_vec();
        let [split, merge] = history.split_and_merge().unwrap();
        assert_eq!((split.slot, merge.slot), (200, 200));
        assert_eq!(history.slots().vertices(), before);
        let merge = history.merge().unwrap();
        assert_eq!(history.split_at(merge.point).unwrap().slot, 199);
    }

    #[test]
    fn the_same_seed_gives_the_same_updates() {
        let organ = Organ::new(Size::Quick).unwrap();
        let mut runs = [5, 5, 6].map(|seed| History::new(&organ, "linear", 9, seed).unwrap());
        let slots = |history: &mut History| -> Vec<Vec<usize>> {
            (0..12).map(|_| history.step().unwrap().ring.slots).collect()
        };
        let [a, b, c] = runs.each_mut().map(slots);
        assert_eq!(a, b);
        assert_ne!(a, c);
    }
}
