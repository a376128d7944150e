//! A mesh that can be refined, and what its tetrahedra are made of.

use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6, Vector3};
use yawara_corot::rotation::polar_warm;
use yawara_corot::{Body, Element};
use yawara_embed::{Embedding, LinearTet, MixedModuli};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{BisectionForest, Placement, Tet, VertexId};

use super::indicator::RingMember;
use crate::body::{BodyState, Cell, EmbeddedMemory, Hold};
use crate::error::SimError;

/// Why [`is_of_parts`] is asked.
pub(super) const EDITS: &str = ": a tool changes labels or cuts";

/// Whether a homogenisation gives every part of the body its material by itself.
///
/// # Errors
/// [`SimError::Value`] with `why` for one of the whole body.
pub(super) fn is_of_parts(embedding: &Embedding, scene: &str, why: &str) -> Result<(), SimError> {
    let homogenisation = embedding.homogenisation();
    match homogenisation.global() {
        None => Ok(()),
        Some(_) => {
            let want = format!("one of parts, such as laminate{why}");
            Err(SimError::value(scene, "stages.homogenisation", homogenisation.name(), want))
        }
    }
}

/// The bisection forest with the embedding of the image's material.
pub(crate) struct Content {
    pub forest: BisectionForest,
    pub embedding: Embedding,
    pub placement: Placement,
    /// What its tetrahedra remember; none of linear elastic ones.
    pub memory: Option<EmbeddedMemory>,
    /// The labels as they are now, if a tool changes them.
    pub volume: Option<Arc<LabelVolume>>,
    /// Labels as in the image, by dense label.
    pub label_values: Vec<i64>,
    /// By dense label the entry of the scene's materials; none of void.
    pub material_of: Vec<Option<usize>>,
}

impl Content {
    /// The mesh at rest, of the elements of an empty `body`. `holds` is by vertex number.
    pub fn state(&self, holds: &[Hold], body: Body) -> BodyState {
        let mut state = BodyState::new(body);
        for v in self.forest.vertices() {
            let rest = self.placement.position(self.forest.point(v));
            state.add_vertex(v, rest, rest, holds[v.index()]);
        }
        for tet in self.forest.leaves() {
            self.add_tet(&mut state, &tet, &Matrix3::identity());
        }
        state
    }

    /// Brings a tetrahedron of the forest into `state`, with the rotation that it starts from.
    pub fn add_tet(&self, state: &mut BodyState, tet: &Tet, rotation: &Matrix3<f64>) {
        let element = Element {
            tet: tet.id,
            vertices: tet.vertices.map(VertexId::index),
            geometry: rest_geometry(state, tet),
            elasticity: self.embedding.elasticity(tet.node),
        };
        let label = self.embedding.tree().majority(tet.node);
        let memory = self.memory.as_ref();
        let made_of = memory.map_or_else(Vec::new, |memory| memory.made_of(tet.node, label));
        state.add_tet(element, rotation, self.cell(tet), &made_of);
    }

    /// What is known of a tetrahedron besides its mechanics.
    pub fn cell(&self, tet: &Tet) -> Cell {
        let label = self.embedding.tree().majority(tet.node);
        Cell {
            level: tet.level,
            label: self.label_values[usize::from(label)],
            density_kg_m3: self.embedding.density(tet.node),
            is_void: self.is_void(tet),
        }
    }

    fn is_void(&self, tet: &Tet) -> bool {
        self.embedding.tree().labels(tet.node).as_slice() == [0]
    }

    /// A tetrahedron of a ring as indicators see it.
    pub fn member(&self, state: &BodyState, tet: &Tet) -> RingMember {
        let (geometry, rotation) = match state.body.number(tet.id) {
            Some(number) => (state.elements()[number].geometry, Some(state.body.rotation(number))),
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

    /// Where the embedding has the midpoint of a ring: ½(x_a+x_b) + Σ V R X ε / Σ V.
    pub fn embedded_midpoint(&self, state: &BodyState, ring: &[Tet]) -> Vector3<f64> {
        let tet = ring[0];
        let ends = [tet.vertices[0], tet.vertices[bisected_corner(tet.level)]];
        let middle = 0.5 * (state.positions[ends[0].index()] + state.positions[ends[1].index()]);
        let (mut offset, mut volume) = (Vector3::zeros(), 0.0);
        for tet in ring {
            let member = self.member(state, tet);
            offset += member.midpoint_offset() * member.geometry.volume;
            volume += member.geometry.volume;
        }
        middle + offset / volume
    }
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
