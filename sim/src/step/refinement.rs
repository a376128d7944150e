//! Splits and merges: who comes in, who goes out, and the repair of all later stages.

use std::time::Instant;

use nalgebra::{Matrix3, Matrix6, Vector3};
use yawara_corot::rotation::polar_warm;
use yawara_corot::{Body, Element};
use yawara_embed::{Embedding, LinearTet, MixedModuli};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{
    BisectionForest, ClosureQueue, Lattice, MeshDelta, Placement, Point, Tet, TetId, VertexId,
};

use super::indicator::{Indicator, RingMember};
use crate::body::{BodyState, Cell, Hold};
use crate::error::SimError;
use crate::inverse::InverseLink;
use crate::report::{StageTimes, milliseconds};
use crate::scene::Refinement;
use crate::tools::Regions;

/// What splits and merges go by: the forest and its content. It changes a [`BodyState`].
pub(crate) struct Refiner {
    pub forest: BisectionForest,
    pub embedding: Embedding,
    pub placement: Placement,
    label_values: Vec<i64>,
    /// Where new vertices are held.
    regions: Regions,
    /// Step in which each vertex came in.
    born: Vec<usize>,
    /// Last measured indicator of each tetrahedron's ring, by tetrahedron number.
    measured: Vec<f64>,
    delta: MeshDelta,
    ring: Vec<Tet>,
    members: Vec<RingMember>,
    /// Splits that are wanted, as last measured.
    waiting: ClosureQueue,
}

/// What one round of remeshing did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Remeshed {
    pub splits: usize,
    pub merges: usize,
}

/// What asks for refinement, and how much of it there may be.
pub(crate) struct Demand<'a> {
    pub rules: &'a Refinement,
    pub max_vertices: usize,
    pub indicator: &'a dyn Indicator,
    /// When the time for splits is over.
    pub deadline: Option<Instant>,
}

impl Demand<'_> {
    fn is_over(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

impl Refiner {
    /// Takes a start mesh over; the state it starts in comes with it, made of the elements of an
    /// empty `body`. `holds` is by vertex number.
    pub fn new(
        forest: BisectionForest,
        embedding: Embedding,
        placement: Placement,
        label_values: Vec<i64>,
        holds: &[Hold],
        regions: Regions,
        body: Body,
    ) -> (Self, BodyState) {
        let refiner = Self {
            born: vec![0; forest.vertex_capacity()],
            forest,
            embedding,
            placement,
            label_values,
            regions,
            measured: Vec::new(),
            delta: MeshDelta::empty(),
            ring: Vec::new(),
            members: Vec::new(),
            waiting: ClosureQueue::new(),
        };
        let mut state = BodyState::new(body);
        for v in refiner.forest.vertices() {
            let rest = refiner.placement.position(refiner.forest.point(v));
            state.add_vertex(v, rest, rest, holds[v.index()]);
        }
        for tet in refiner.forest.leaves() {
            refiner.add_tet(&mut state, &tet, Matrix3::identity());
        }
        (refiner, state)
    }

    fn add_tet(&self, state: &mut BodyState, tet: &Tet, rotation: Matrix3<f64>) {
        let element = Element {
            tet: tet.id,
            vertices: tet.vertices.map(VertexId::index),
            geometry: rest_geometry(state, tet),
            elasticity: self.embedding.elasticity(tet.node),
            rotation,
        };
        let label = self.embedding.tree().majority(tet.node);
        let cell = Cell {
            level: tet.level,
            label: self.label_values[usize::from(label)],
            density_kg_m3: self.embedding.density(tet.node),
            is_void: self.is_void(tet),
        };
        state.add_tet(element, cell);
    }

    fn is_void(&self, tet: &Tet) -> bool {
        self.embedding.tree().labels(tet.node).as_slice() == [0]
    }

    /// Last measured indicator of a leaf's ring; 0 if never measured.
    pub fn measured(&self, tet: TetId) -> f64 {
        self.measured.get(tet.index()).copied().unwrap_or(0.0)
    }

    /// Splits that are wanted and have to wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Merges where the indicator has become small, then splits where it is large.
    pub fn remesh(
        &mut self,
        state: &mut BodyState,
        step: usize,
        demand: &Demand<'_>,
        inverse: &mut InverseLink,
        times: &mut StageTimes,
    ) -> Result<Remeshed, SimError> {
        let begin = Instant::now();
        let leaving = self.wanted_merges(state, step, demand);
        self.rank_splits(state, demand)?;
        times.indicator_ms = milliseconds(begin);

        let begin = Instant::now();
        let inverse_before = inverse.total_ms;
        let mut done = Remeshed::default();
        for v in leaving {
            self.merge(state, v, inverse)?;
            done.merges += 1;
        }
        for _ in 0..demand.rules.max_splits_per_step {
            let full = self.forest.vertex_count() >= demand.max_vertices;
            let Some((p, _)) = self.waiting.best().filter(|_| !full && !demand.is_over()) else {
                break;
            };
            self.waiting.remove(p);
            // A merge of this round may have taken an older vertex that `p` needs.
            if self.forest.split_ring(p, &mut self.ring) {
                self.split(state, p, step, inverse)?;
                done.splits += 1;
                // A clock has to see what each split costs.
                if demand.deadline.is_some() {
                    inverse.flush()?;
                }
            }
        }
        inverse.flush()?;
        times.inverse_ms = inverse.total_ms - inverse_before;
        times.remesh_ms = milliseconds(begin) - times.inverse_ms;
        Ok(done)
    }

    /// Has all splits that are wanted now wait, the largest indicator first. What waited before is
    /// measured again with all others: no wish outlives its cause, and none loses its place.
    fn rank_splits(&mut self, state: &BodyState, demand: &Demand<'_>) -> Result<(), SimError> {
        self.measured.clear();
        self.measured.resize(self.forest.tet_capacity(), 0.0);
        self.waiting.clear();
        for p in self.forest.candidates() {
            if !self.forest.split_ring(p, &mut self.ring) {
                continue;
            }
            let value = self.measure_ring(state, demand.indicator);
            for tet in &self.ring {
                self.measured[tet.id.index()] = value;
            }
            if value > demand.rules.split_above {
                // Beyond all numbers is still a wish like others.
                self.waiting.push(p, value.min(f64::MAX))?;
            }
        }
        Ok(())
    }

    fn wanted_merges(
        &mut self,
        state: &BodyState,
        step: usize,
        demand: &Demand<'_>,
    ) -> Vec<VertexId> {
        let rules = demand.rules;
        let limit = rules.merge_fraction * rules.split_above;
        let settled: Vec<VertexId> = self
            .forest
            .vertices()
            .filter(|v| step >= self.born[v.index()] + rules.dwell_steps)
            // A tool keeps what it holds until it lets go.
            .filter(|v| !matches!(state.holds[v.index()], Hold::Grabbed(_)))
            .collect();
        settled
            .into_iter()
            .filter(|&v| {
                self.forest.merge_ring(v, &mut self.ring)
                    && self.measure_ring(state, demand.indicator) <= limit
            })
            .collect()
    }

    /// The indicator of the coarse tetrahedra now in `self.ring`.
    fn measure_ring(&mut self, state: &BodyState, indicator: &dyn Indicator) -> f64 {
        self.members.clear();
        for tet in &self.ring {
            self.members.push(self.member(state, tet));
        }
        indicator.measure(&self.members)
    }

    fn member(&self, state: &BodyState, tet: &Tet) -> RingMember {
        let (geometry, rotation) = match state.body.element(tet.id) {
            Some(element) => (element.geometry, Some(element.rotation)),
            None => (rest_geometry(state, tet), None),
        };
        let (halves, parent) = self.embedding.combine(tet.node, &geometry, tet.level);
        let f = geometry.gradient(&tet.vertices.map(|v| state.positions[v.index()]));
        let [a, b] = [0, bisected_corner(tet.level)].map(|corner| tet.vertices[corner].index());
        // A vertex that came in since the last evaluation has no rotation of its own yet.
        let turned = |v: usize| state.body.vertex_rotations().get(v).copied();
        RingMember {
            parent,
            halves,
            edge: state.rest[b] - state.rest[a],
            end_rotations: [a, b].map(|v| turned(v).unwrap_or_else(Matrix3::identity)),
            deformation_gradient: f,
            rotation: rotation.unwrap_or_else(|| {
                polar_warm(&f, &state.body.vertex_rotations()[tet.vertices[0].index()])
            }),
            geometry,
            pressed_dilation: pressed_dilation(state, tet, &parent.elasticity),
            is_void: self.is_void(tet),
        }
    }

    /// Where the embedding has the midpoint of the ring now in `self.ring`:
    /// ½(x_a+x_b) + Σ V R X ε / Σ V.
    fn embedded_midpoint(&self, state: &BodyState) -> Vector3<f64> {
        let tet = self.ring[0];
        let ends = [tet.vertices[0], tet.vertices[bisected_corner(tet.level)]];
        let middle = 0.5 * (state.positions[ends[0].index()] + state.positions[ends[1].index()]);
        let (mut offset, mut volume) = (Vector3::zeros(), 0.0);
        for tet in &self.ring {
            let member = self.member(state, tet);
            offset += member.midpoint_offset() * member.geometry.volume;
            volume += member.geometry.volume;
        }
        middle + offset / volume
    }

    /// Splits at `p`, whose ring is in `self.ring`.
    fn split(
        &mut self,
        state: &mut BodyState,
        p: Point,
        step: usize,
        inverse: &mut InverseLink,
    ) -> Result<(), SimError> {
        let midpoint = self.embedded_midpoint(state);
        let mut around = old_vertices(&self.ring);
        let momentum = state.momentum_of(&around);
        let mut delta = std::mem::replace(&mut self.delta, MeshDelta::empty());
        let vertex = self.forest.split(p, &mut delta)?;
        let rest = self.placement.position(p);
        let hold = self.regions.hold(&rest, around.iter().map(|&v| state.holds[v]));
        // The strain around it would put it elsewhere.
        let position = if hold == Hold::Fixed { rest } else { midpoint };
        state.add_vertex(vertex, rest, position, hold);
        let [a, b] = delta.edge.map(|v| state.body.pressure(v.index()));
        state.body.set_pressure(vertex.index(), 0.5 * (a + b));
        let [a, b] = delta.edge.map(|v| state.velocities[v.index()]);
        state.velocities[vertex.index()] = 0.5 * (a + b);
        self.born.resize(state.vertex_capacity(), 0);
        self.born[vertex.index()] = step;
        for ring_tet in &delta.ring {
            let parent = state.remove_tet(ring_tet.parent.id);
            let rotation = parent.map_or_else(Matrix3::identity, |e| e.rotation);
            for child in &ring_tet.children {
                self.add_tet(state, child, rotation);
            }
        }
        if state.is_dynamic {
            around.push(vertex.index());
            state.pass_on(&around, momentum);
        }
        self.update_inverse(state, &delta, inverse);
        self.delta = delta;
        Ok(())
    }

    fn merge(
        &mut self,
        state: &mut BodyState,
        vertex: VertexId,
        inverse: &mut InverseLink,
    ) -> Result<(), SimError> {
        let mut delta = std::mem::replace(&mut self.delta, MeshDelta::empty());
        self.forest.merge(vertex, &mut delta)?;
        let parents: Vec<Tet> = delta.ring.iter().map(|ring_tet| ring_tet.parent).collect();
        let mut around = old_vertices(&parents);
        around.push(vertex.index());
        let momentum = state.momentum_of(&around);
        for ring_tet in &delta.ring {
            let mut rotation = Matrix3::identity();
            for child in &ring_tet.children {
                if let Some(element) = state.remove_tet(child.id) {
                    rotation = element.rotation;
                }
            }
            self.add_tet(state, &ring_tet.parent, rotation);
        }
        if state.is_dynamic {
            around.pop();
            state.pass_on(&around, momentum);
        }
        self.update_inverse(state, &delta, inverse);
        state.remove_vertex(vertex);
        self.delta = delta;
        Ok(())
    }

    fn update_inverse(&self, state: &BodyState, delta: &MeshDelta, inverse: &mut InverseLink) {
        let ring = inverse.element().ring(delta, &self.embedding, &|v| state.rest[v.index()]);
        let is_fixed = |v: VertexId| state.holds[v.index()] == Hold::Fixed;
        let key = Lattice::key(self.forest.point(delta.vertex));
        inverse.push(delta.change, delta.vertex, is_fixed, key, ring);
    }
}

/// Each vertex of the parents of a ring once.
fn old_vertices(ring: &[Tet]) -> Vec<usize> {
    let mut vertices: Vec<usize> =
        ring.iter().flat_map(|tet| tet.vertices).map(VertexId::index).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// μ q̄/κ where there are pressures.
fn pressed_dilation(state: &BodyState, tet: &Tet, elasticity: &Matrix6<f64>) -> Option<f64> {
    let moduli = state.body.is_mixed().then(|| MixedModuli::new(elasticity).ok())??;
    let sum: f64 = tet.vertices.iter().map(|v| state.body.pressure(v.index())).sum();
    Some(0.25 * sum * moduli.shear / moduli.bulk)
}

fn rest_geometry(state: &BodyState, tet: &Tet) -> LinearTet {
    LinearTet::new(&tet.vertices.map(|v| state.rest[v.index()]))
}
