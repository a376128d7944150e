//! Splits and merges: who comes in, who goes out, and the repair of all later stages.

use std::time::Instant;

use nalgebra::Vector3;
use yawara_corot::rotation::polar_warm;
use yawara_corot::{Body, Element};
use yawara_embed::{Embedding, LinearTet, RingStiffness};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{BisectionForest, Lattice, MeshDelta, Placement, Point, Tet, VertexId};

use crate::error::SimError;
use crate::indicator::{Indicator, RingMember};
use crate::inverse_link::InverseLink;
use crate::report::StageTimes;
use crate::scene::Refinement;
use crate::tools::Hold;

/// A question to a rest position.
pub(crate) type RestTest = Box<dyn Fn(&Vector3<f64>) -> bool + Send>;

/// The state that splits and merges change together.
pub(crate) struct Adaptive {
    pub forest: BisectionForest,
    pub embedding: Embedding,
    pub placement: Placement,
    pub body: Body,
    /// Rest and current positions by vertex number, m.
    pub rest: Vec<Vector3<f64>>,
    pub positions: Vec<Vector3<f64>>,
    pub holds: Vec<Hold>,
    /// Whether a rest position lies in a fixed region.
    is_fixed: RestTest,
    /// Step in which each vertex came in.
    born: Vec<usize>,
    /// Last measured indicator of each tetrahedron's ring, by tetrahedron number.
    measured: Vec<f64>,
    delta: MeshDelta,
    ring: Vec<Tet>,
    members: Vec<RingMember>,
}

/// What one round of remeshing did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Remeshed {
    pub splits: usize,
    pub merges: usize,
}

impl Adaptive {
    pub fn new(
        forest: BisectionForest,
        embedding: Embedding,
        placement: Placement,
        holds: Vec<Hold>,
        is_fixed: RestTest,
    ) -> Self {
        let capacity = forest.vertex_capacity();
        let mut rest = vec![Vector3::zeros(); capacity];
        for v in forest.vertices() {
            rest[v.index()] = placement.position(forest.point(v));
        }
        let mut state = Self {
            positions: rest.clone(),
            rest,
            holds,
            is_fixed,
            born: vec![0; capacity],
            measured: Vec::new(),
            body: Body::new(),
            forest,
            embedding,
            placement,
            delta: MeshDelta::empty(),
            ring: Vec::new(),
            members: Vec::new(),
        };
        let leaves: Vec<Tet> = state.forest.leaves().collect();
        for tet in leaves {
            let element = state.element(&tet, nalgebra::Matrix3::identity());
            state.body.insert(element);
        }
        state
    }

    fn element(&self, tet: &Tet, rotation: nalgebra::Matrix3<f64>) -> Element {
        Element {
            tet: tet.id,
            vertices: tet.vertices.map(VertexId::index),
            geometry: self.rest_geometry(tet),
            elasticity: self.embedding.elasticity(tet.node),
            rotation,
        }
    }

    fn rest_geometry(&self, tet: &Tet) -> LinearTet {
        LinearTet::new(&tet.vertices.map(|v| self.rest[v.index()]))
    }

    /// Last measured indicator of a leaf's ring; 0 if never measured.
    pub fn measured(&self, tet: &Tet) -> f64 {
        self.measured.get(tet.id.index()).copied().unwrap_or(0.0)
    }

    /// Merges where the indicator has become small, then splits where it is large.
    pub fn remesh(
        &mut self,
        step: usize,
        rules: &Refinement,
        max_vertices: usize,
        indicator: &dyn Indicator,
        inverse: &mut InverseLink,
        times: &mut StageTimes,
    ) -> Result<Remeshed, SimError> {
        let begin = Instant::now();
        let leaving = self.wanted_merges(step, rules, indicator);
        let arriving = self.wanted_splits(rules, indicator);
        times.indicator_ms = milliseconds(begin);

        let begin = Instant::now();
        let inverse_before: f64 = inverse.update_ms.iter().sum();
        let mut done = Remeshed::default();
        for v in leaving {
            self.merge(v, inverse)?;
            done.merges += 1;
        }
        for p in arriving {
            if self.forest.vertex_count() >= max_vertices {
                break;
            }
            // A merge of this round may have taken an older vertex that `p` needs.
            if self.forest.split_ring(p, &mut self.ring) {
                self.split(p, step, inverse)?;
                done.splits += 1;
            }
        }
        times.inverse_ms = inverse.update_ms.iter().sum::<f64>() - inverse_before;
        times.remesh_ms = milliseconds(begin) - times.inverse_ms;
        Ok(done)
    }

    /// Points to split at, largest indicator first.
    fn wanted_splits(&mut self, rules: &Refinement, indicator: &dyn Indicator) -> Vec<Point> {
        let mut wanted: Vec<(f64, Point)> = Vec::new();
        self.measured.clear();
        self.measured.resize(self.forest.tet_capacity(), 0.0);
        for p in self.forest.candidates() {
            if !self.forest.split_ring(p, &mut self.ring) {
                continue;
            }
            let value = self.measure_ring(indicator);
            for tet in &self.ring {
                self.measured[tet.id.index()] = value;
            }
            if value > rules.split_above {
                wanted.push((value, p));
            }
        }
        // Candidates come in the order of their keys, and the sort is stable.
        wanted.sort_by(|a, b| b.0.total_cmp(&a.0));
        wanted.truncate(rules.max_splits_per_step);
        wanted.into_iter().map(|(_, p)| p).collect()
    }

    fn wanted_merges(
        &mut self,
        step: usize,
        rules: &Refinement,
        indicator: &dyn Indicator,
    ) -> Vec<VertexId> {
        let limit = rules.merge_fraction * rules.split_above;
        let settled: Vec<VertexId> = self
            .forest
            .vertices()
            .filter(|v| step >= self.born[v.index()] + rules.dwell_steps)
            .collect();
        settled
            .into_iter()
            .filter(|&v| {
                self.forest.merge_ring(v, &mut self.ring) && self.measure_ring(indicator) <= limit
            })
            .collect()
    }

    /// The indicator of the coarse tetrahedra now in `self.ring`.
    fn measure_ring(&mut self, indicator: &dyn Indicator) -> f64 {
        self.members.clear();
        for tet in &self.ring {
            self.members.push(self.member(tet));
        }
        indicator.measure(&self.members)
    }

    fn member(&self, tet: &Tet) -> RingMember {
        let (geometry, rotation) = match self.body.element(tet.id) {
            Some(element) => (element.geometry, Some(element.rotation)),
            None => (self.rest_geometry(tet), None),
        };
        let (halves, parent) = self.embedding.combine(tet.node, &geometry, tet.level);
        let f = geometry.gradient(&tet.vertices.map(|v| self.positions[v.index()]));
        RingMember {
            parent,
            halves,
            deformation_gradient: f,
            rotation: rotation.unwrap_or_else(|| {
                polar_warm(&f, &self.body.vertex_rotations()[tet.vertices[0].index()])
            }),
            geometry,
            is_void: self.embedding.tree().labels(tet.node).as_slice() == [0],
        }
    }

    /// Where the embedding has the midpoint of the ring now in `self.ring`:
    /// ½(x_a+x_b) + Σ V R X ε / Σ V.
    fn embedded_midpoint(&mut self) -> Vector3<f64> {
        let tet = self.ring[0];
        let ends = [tet.vertices[0], tet.vertices[bisected_corner(tet.level)]];
        let middle = 0.5 * (self.positions[ends[0].index()] + self.positions[ends[1].index()]);
        let (mut offset, mut volume) = (Vector3::zeros(), 0.0);
        for tet in &self.ring {
            let member = self.member(tet);
            offset += member.midpoint_offset() * member.geometry.volume;
            volume += member.geometry.volume;
        }
        middle + offset / volume
    }

    /// Splits at `p`, whose ring is in `self.ring`.
    fn split(&mut self, p: Point, step: usize, inverse: &mut InverseLink) -> Result<(), SimError> {
        let position = self.embedded_midpoint();
        let mut delta = std::mem::replace(&mut self.delta, MeshDelta::empty());
        let vertex = self.forest.split(p, &mut delta)?;
        self.grow(vertex.index() + 1);
        let at = vertex.index();
        self.rest[at] = self.placement.position(p);
        self.positions[at] = position;
        self.born[at] = step;
        let ends = delta.edge.map(|v| self.holds[v.index()]);
        // Between two fixed regions that face each other the body is free.
        let held =
            ends[0] == ends[1] && (ends[0] != Hold::Fixed || (self.is_fixed)(&self.rest[at]));
        self.holds[at] = if held { ends[0] } else { Hold::Free };
        for ring_tet in &delta.ring {
            let parent = self.body.remove(ring_tet.parent.id);
            let rotation = parent.map_or_else(nalgebra::Matrix3::identity, |e| e.rotation);
            for child in &ring_tet.children {
                let element = self.element(child, rotation);
                self.body.insert(element);
            }
        }
        self.update_inverse(&delta, inverse)?;
        self.delta = delta;
        Ok(())
    }

    fn merge(&mut self, vertex: VertexId, inverse: &mut InverseLink) -> Result<(), SimError> {
        let mut delta = std::mem::replace(&mut self.delta, MeshDelta::empty());
        self.forest.merge(vertex, &mut delta)?;
        for ring_tet in &delta.ring {
            let mut rotation = nalgebra::Matrix3::identity();
            for child in &ring_tet.children {
                if let Some(element) = self.body.remove(child.id) {
                    rotation = element.rotation;
                }
            }
            let element = self.element(&ring_tet.parent, rotation);
            self.body.insert(element);
        }
        self.update_inverse(&delta, inverse)?;
        self.holds[vertex.index()] = Hold::Free;
        self.delta = delta;
        Ok(())
    }

    fn update_inverse(&self, delta: &MeshDelta, inverse: &mut InverseLink) -> Result<(), SimError> {
        let ring = RingStiffness::new(delta, &self.embedding, |v| self.rest[v.index()]);
        let fixed = self.holds[delta.vertex.index()] == Hold::Fixed;
        let key = Lattice::key(self.forest.point(delta.vertex));
        inverse.apply(delta.change, delta.vertex, fixed, key, &ring)
    }

    fn grow(&mut self, length: usize) {
        if self.rest.len() < length {
            self.rest.resize(length, Vector3::zeros());
            self.positions.resize(length, Vector3::zeros());
            self.holds.resize(length, Hold::Free);
            self.born.resize(length, 0);
        }
    }
}

/// Time since `begin`, ms.
pub(crate) fn milliseconds(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}
