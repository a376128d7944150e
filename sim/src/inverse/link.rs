//! A maintained inverse that follows the splits and merges of a mesh.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use faer::Mat;
use nalgebra::Matrix4;
use yawara_corot::Body;
use yawara_embed::{ContentStiffness, ElementFormulation, RingStiffness};
use yawara_inverse_update::{InverseError, InverseMaintainer, SparseStiffness, Update};
use yawara_mesh::{Change, TetId, VertexId};

use super::DISPLACEMENTS;
use super::assembly::{Assembly, needs_slot};
use super::hand_over::hold;
use super::held::{Constrained, Held};
use super::slots::SlotMap;
use crate::error::SimError;

/// Makes a maintainer of the inverse of a stiffness matrix.
pub type InverseFactory =
    Box<dyn Fn(SparseStiffness) -> Result<Box<dyn InverseMaintainer>, InverseError>>;

/// The inverse with the map from vertices to its slots. Fixed vertices have none, unless their
/// element has more unknowns than displacements: those stay, and the displacements are clamped.
pub struct InverseLink {
    maintainer: Box<dyn InverseMaintainer>,
    element: Box<dyn ElementFormulation>,
    /// Stiffness that holds clamped displacements, N/m.
    anchor: f64,
    slots: SlotMap,
    held: Mutex<Option<Arc<Held>>>,
    /// Updates that the maintainer has not been given yet, and the time spent on them so far.
    pending: Vec<Update>,
    pending_ms: f64,
    /// Splits and merges among them, those that leave K as it is included.
    pending_count: usize,
    /// Of each update its share of the batch that it was made in.
    pub(crate) update_ms: Vec<f64>,
    /// Σ of those.
    pub(crate) total_ms: f64,
    pub(crate) updates: usize,
    pub(crate) batches: usize,
    pub(crate) drift_max: f64,
}

impl InverseLink {
    /// Assembles the stiffness of `body` in the unknowns of `element` on `vertices` and inverts it.
    ///
    /// `density` of a tetrahedron, kg/m³, is asked where the element's
    /// [matrix](ElementFormulation::matrix) has a mass. `is_fixed` tells by vertex number whose
    /// displacements are fixed, `order_key` where a vertex lies, see
    /// [`SparseStiffness::set_order_keys`].
    /// # Errors
    /// [`SimError::Inverse`] if that stiffness is not (quasi-)definite.
    pub fn new(
        body: &Body,
        density: &dyn Fn(TetId) -> f64,
        element: Box<dyn ElementFormulation>,
        vertices: impl Iterator<Item = VertexId>,
        is_fixed: impl Fn(usize) -> bool,
        order_key: impl Fn(VertexId) -> u64,
        factory: &InverseFactory,
    ) -> Result<Self, SimError> {
        let anchor = body.stiffness_scale();
        let assembly = Assembly {
            element: element.as_ref(),
            is_fixed: &|v| is_fixed(v.index()),
            anchor,
            density,
            springs: &|tet| body.grip_matrix(tet),
            order_key: &order_key,
        };
        let slots = assembly.slots(vertices);
        let stiffness = assembly.assemble(body.elements(), &slots)?;
        Ok(Self {
            maintainer: factory(stiffness)?,
            element,
            anchor,
            slots,
            held: Mutex::new(None),
            pending: Vec::new(),
            pending_ms: 0.0,
            pending_count: 0,
            update_ms: Vec::new(),
            total_ms: 0.0,
            updates: 0,
            batches: 0,
            drift_max: 0.0,
        })
    }

    /// The maintainer.
    pub fn maintainer(&self) -> &dyn InverseMaintainer {
        self.maintainer.as_ref()
    }

    /// The unknowns of a tetrahedron.
    pub fn element(&self) -> &dyn ElementFormulation {
        self.element.as_ref()
    }

    /// Slot of a vertex, if it has one.
    pub fn slot(&self, vertex: usize) -> Option<usize> {
        self.slots.get(VertexId(vertex as u32))
    }

    /// Takes a split or merge with the hand-over of [`element`](Self::element); `is_fixed` tells
    /// whose displacements are fixed, `order_key` where the vertex lies. [`flush`](Self::flush)
    /// gives it to the maintainer.
    pub fn push(
        &mut self,
        change: Change,
        vertex: VertexId,
        is_fixed: impl Fn(VertexId) -> bool,
        order_key: u64,
        ring: RingStiffness,
    ) {
        let begin = Instant::now();
        let new_is_fixed = is_fixed(vertex);
        let has_unknowns = needs_slot(self.element.as_ref(), new_is_fixed);
        let ring = hold(ring, self.element.unknowns(), new_is_fixed, is_fixed, self.anchor);
        self.pending.extend(self.slots.update(change, vertex, has_unknowns, ring, order_key));
        self.pending_count += 1;
        self.pending_ms += begin.elapsed().as_secs_f64() * 1e3;
    }

    /// Takes springs on the corners of tetrahedra out of the stiffness: κ Σ w λλᵀ of each, N/m, the
    /// same for each axis.
    ///
    /// # Errors
    /// [`SimError::Embed`] if they are not finite; [`SimError::Inverse`] if the maintainer refuses.
    pub fn remove_springs(
        &mut self,
        springs: &[([usize; 4], Matrix4<f64>)],
    ) -> Result<(), SimError> {
        let m = self.element.unknowns();
        for (corners, springs) in springs {
            let alike = |i: usize, j: usize| i % m == j % m && i % m < DISPLACEMENTS;
            let entry = |i, j| if alike(i, j) { springs[(i / m, j / m)] } else { 0.0 };
            let matrices = [Mat::from_fn(4 * m, 4 * m, entry), Mat::zeros(4 * m, 4 * m)];
            let vertices = corners.map(|v| VertexId(v as u32));
            let content = ContentStiffness::new(vertices, [false; 4], matrices)?;
            self.pending.extend(self.slots.content_change(&content).map(Update::Content));
            self.pending_count += 1;
        }
        self.flush()
    }

    /// Makes all splits and merges since the last call, in one batch.
    /// # Errors
    /// [`SimError::Inverse`] if the maintainer refuses one: those before it are made, and the body
    /// can't go on.
    pub fn flush(&mut self) -> Result<(), SimError> {
        let count = std::mem::take(&mut self.pending_count);
        if count == 0 {
            return Ok(());
        }
        let begin = Instant::now();
        self.updates += count;
        self.batches += 1;
        let made = self.maintainer.batch(&std::mem::take(&mut self.pending));
        // The caller made single splits and merges: its error is that of the one refused.
        made.map_err(|error| match error {
            InverseError::Batch { source, .. } => *source,
            other => other,
        })?;
        let before_ms = std::mem::take(&mut self.pending_ms);
        let elapsed_ms = before_ms + begin.elapsed().as_secs_f64() * 1e3;
        self.update_ms.extend(std::iter::repeat_n(elapsed_ms / count as f64, count));
        self.total_ms += elapsed_ms;
        Ok(())
    }

    /// Lets the maintainer check a few random columns, and rebuild if they have drifted too far;
    /// keeps the largest drift seen.
    pub(crate) fn watch(&mut self, seed: u64) -> Result<(), SimError> {
        let rebuilds = self.maintainer.counts().rebuilds;
        self.drift_max = self.drift_max.max(self.maintainer.watch(seed)?);
        if self.maintainer.counts().rebuilds > rebuilds {
            // The held vertices' columns are of the inverse before.
            *self.held.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
        }
        Ok(())
    }

    /// The inverse with `held` vertices (not fixed ones) fixed as well.
    pub(crate) fn constrained(&self, held: &[usize]) -> Result<Constrained<'_>, SimError> {
        let slots: Vec<usize> = held.iter().filter_map(|&v| self.slot(v)).collect();
        let unknowns = self.element.unknowns();
        let maintainer = self.maintainer.as_ref();
        let mut known = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let is_current = |known: &&Arc<Held>| known.updates == self.updates && known.slots == slots;
        let held = match known.as_ref().filter(is_current) {
            Some(held) => Arc::clone(held),
            None => Arc::new(Held::new(maintainer, unknowns, self.updates, slots)?),
        };
        *known = Some(Arc::clone(&held));
        Ok(Constrained { maintainer, slots: &self.slots, unknowns, held })
    }
}
