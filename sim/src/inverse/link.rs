//! A maintained inverse that follows the splits and merges of a mesh.

use std::mem::take;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use faer::Mat;
use nalgebra::{Matrix4, Matrix6};
use serde::{Deserialize, Serialize};
use yawara_embed::{ContentStiffness, ElementFormulation, LinearTet, RingStiffness};
use yawara_inverse_update::{Counts, InverseError, InverseMaintainer, SparseStiffness, Update};
use yawara_mesh::{Change, CutDelta, Doubled, Recast, Tet, TetId, VertexId};

use super::DISPLACEMENTS;
use super::hand_over::hold;
use super::held::{Constrained, Held};
use super::layout::{Elements, Layout};
use crate::error::SimError;

/// Updates from one measurement of the drift to the next, at least.
const WATCH_EVERY: usize = 16;

/// What a tetrahedron is made of: its geometry, its elasticity (Pa), its density (kg/m³).
type MadeOf<'a> = dyn Fn(&Tet) -> (LinearTet, Matrix6<f64>, f64) + 'a;

/// Makes a maintainer of the inverse of a stiffness matrix.
pub type InverseFactory =
    Box<dyn Fn(SparseStiffness) -> Result<Box<dyn InverseMaintainer>, InverseError> + Send>;

/// The inverse with the map from vertices to its slots. Fixed vertices have none, unless their
/// element has more unknowns than displacements: those stay, and the displacements are clamped.
///
/// After each batch the rows of K that it has touched are summed afresh from the elements, so that
/// what updates round away does not add up; and where an update is refused, K is assembled from them
/// and inverted anew.
pub struct InverseLink {
    maintainer: Box<dyn InverseMaintainer>,
    factory: InverseFactory,
    layout: Layout,
    /// Vertices whose rows the pending updates change; some may be gone.
    touched: Vec<VertexId>,
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
    /// Those when the drift was measured last.
    watched: usize,
    pub(crate) batches: usize,
    pub(crate) drift_max: f64,
    /// Times that an update was refused and K assembled and inverted anew.
    pub(crate) reassemblies: usize,
    /// The counts of the maintainers before.
    earlier: Counts,
}

/// Counts and times of an inverse so far.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct KeptInverse {
    updates: usize,
    watched: usize,
    batches: usize,
    reassemblies: usize,
    drift_max: f64,
    /// Rebuilds, those by drift, failed pivots, steps of refinement.
    counts: [usize; 4],
    update_ms: Vec<f64>,
    total_ms: f64,
}

impl InverseLink {
    /// Assembles the stiffness of `elements` in the unknowns of `element` on `vertices` and inverts it.
    ///
    /// `is_fixed` tells by vertex number whose displacements are fixed, `order_key` where a vertex
    /// lies, see [`SparseStiffness::set_order_keys`].
    /// # Errors
    /// [`SimError::Inverse`] if that stiffness is not (quasi-)definite.
    pub fn new(
        elements: &Elements<'_>,
        element: Box<dyn ElementFormulation>,
        vertices: impl Iterator<Item = VertexId>,
        is_fixed: impl Fn(usize) -> bool,
        order_key: impl Fn(VertexId) -> u64,
        factory: InverseFactory,
    ) -> Result<Self, SimError> {
        let mut layout = Layout::new(element, elements.body.stiffness_scale());
        layout.number(vertices, is_fixed, order_key);
        Ok(Self {
            maintainer: factory(layout.assemble(elements)?)?,
            factory,
            layout,
            touched: Vec::new(),
            held: Mutex::new(None),
            pending: Vec::new(),
            pending_ms: 0.0,
            pending_count: 0,
            update_ms: Vec::new(),
            total_ms: 0.0,
            updates: 0,
            watched: 0,
            batches: 0,
            drift_max: 0.0,
            reassemblies: 0,
            earlier: Counts::default(),
        })
    }

    /// The maintainer.
    pub fn maintainer(&self) -> &dyn InverseMaintainer {
        self.maintainer.as_ref()
    }

    /// The unknowns of a tetrahedron.
    pub fn element(&self) -> &dyn ElementFormulation {
        self.layout.element.as_ref()
    }

    /// Slot of a vertex, if it has one.
    pub fn slot(&self, vertex: usize) -> Option<usize> {
        self.layout.slots.get(VertexId(vertex as u32))
    }

    /// The safeguards that took effect in the maintainer, and in those before it.
    pub(crate) fn counts(&self) -> Counts {
        let mut counts = self.earlier;
        counts += self.maintainer.counts();
        counts
    }

    /// Takes a split or merge with the hand-over of [`element`](Self::element); `is_fixed` tells
    /// whether the vertex's displacements are fixed, `order_key` where it lies.
    /// [`flush`](Self::flush) gives it to the maintainer.
    pub fn push(
        &mut self,
        change: Change,
        vertex: VertexId,
        is_fixed: bool,
        order_key: u64,
        ring: RingStiffness,
    ) {
        let begin = Instant::now();
        self.touched.extend(ring.vertices.iter().copied().chain([vertex]));
        let layout = &mut self.layout;
        let has_unknowns = layout.note(vertex, is_fixed, order_key);
        let (unknowns, anchor) = (layout.element.unknowns(), layout.anchor);
        let ring = hold(ring, unknowns, is_fixed, |v| layout.is_fixed(v), anchor);
        self.pending.extend(layout.slots.update(change, vertex, has_unknowns, ring, order_key));
        self.pending_count += 1;
        self.pending_ms += begin.elapsed().as_secs_f64() * 1e3;
    }

    /// Takes another matrix in the place of the one that a leaf with these corners had, N/m, in the unknowns of
    /// [`element`](Self::element). [`flush`](Self::flush) gives it to the maintainer.
    ///
    /// # Errors
    /// [`SimError::Embed`] if one of them is not finite.
    pub fn change(
        &mut self,
        corners: [VertexId; 4],
        matrices: [Mat<f64>; 2],
    ) -> Result<(), SimError> {
        let begin = Instant::now();
        self.touched.extend(corners);
        let held = corners.map(|v| self.layout.is_fixed(v));
        let content = ContentStiffness::new(corners, held, matrices)?;
        let change = self.layout.slots.content_change(&content);
        self.pending.extend(change.map(Update::Content));
        self.pending_count += 1;
        self.pending_ms += begin.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// Takes a cut or its closing. `made_of` tells the geometry, the elasticity (Pa) and the density (kg/m³) of each
    /// sheet, of those before and those after; `springs` those of elastic grips on tetrahedra that keep their sheets;
    /// `is_fixed` and `order_key` are as for [`push`](Self::push). [`flush`](Self::flush) gives it to the maintainer.
    ///
    /// # Errors
    /// [`SimError::Embed`] if a matrix is not finite.
    pub fn cut(
        &mut self,
        delta: &CutDelta,
        made_of: &MadeOf<'_>,
        springs: &dyn Fn(TetId) -> Option<Matrix4<f64>>,
        is_fixed: &dyn Fn(VertexId) -> bool,
        order_key: &dyn Fn(VertexId) -> u64,
    ) -> Result<(), SimError> {
        let matrix = |tet: &Tet| {
            let (geometry, elasticity, density) = made_of(tet);
            self.layout.element.matrix(&geometry, &elasticity, density)
        };
        let sum = |sheets: &[Tet]| {
            let n = 4 * self.layout.element.unknowns();
            sheets.iter().map(matrix).fold(Mat::zeros(n, n), |sum, k| sum + k)
        };
        let recast = delta
            .recast
            .iter()
            .map(|Recast { before, after }| (before[0].vertices, [sum(before), sum(after)]));
        let recast: Vec<_> = recast.collect();
        let m = self.layout.element.unknowns();
        let rings = delta.doubled.iter().map(|Doubled { vertex, twin, tets }| {
            let at_twin = |tet: &Tet| {
                let corners = tet.vertices.map(|v| if v == *vertex { *twin } else { v });
                let held =
                    springs(tet.id).map_or_else(|| Mat::zeros(4 * m, 4 * m), |of| on_axes(&of, m));
                (corners, matrix(tet) + held)
            };
            let tets: Vec<([VertexId; 4], Mat<f64>)> = tets.iter().map(at_twin).collect();
            RingStiffness::doubled(m, *twin, &tets)
        });
        let rings: Vec<RingStiffness> = rings.collect();
        let double = |link: &mut Self| {
            for (Doubled { vertex, .. }, ring) in delta.doubled.iter().zip(rings) {
                link.push(delta.change, *vertex, is_fixed(*vertex), order_key(*vertex), ring);
            }
        };
        if delta.change == Change::Split {
            recast
                .into_iter()
                .try_for_each(|(corners, matrices)| self.change(corners, matrices))?;
            double(self);
        } else {
            double(self);
            recast
                .into_iter()
                .try_for_each(|(corners, matrices)| self.change(corners, matrices))?;
        }
        Ok(())
    }

    /// Takes springs on the corners of a tetrahedron into the stiffness, N/m, the same for each axis.
    /// [`flush`](Self::flush) gives them to the maintainer.
    ///
    /// # Errors
    /// [`SimError::Embed`] if they are not finite.
    pub fn add_springs(
        &mut self,
        corners: [VertexId; 4],
        springs: &Matrix4<f64>,
    ) -> Result<(), SimError> {
        let springs = on_axes(springs, self.layout.element.unknowns());
        self.change(corners, [Mat::zeros(springs.nrows(), springs.ncols()), springs])
    }

    /// Takes springs on the corners of tetrahedra out of the stiffness: κ Σ w λλᵀ of each, N/m, the
    /// same for each axis. `elements` are without them already.
    ///
    /// # Errors
    /// [`SimError::Embed`] if they are not finite; those of [`flush`](Self::flush).
    pub fn remove_springs(
        &mut self,
        springs: &[([usize; 4], Matrix4<f64>)],
        elements: &Elements<'_>,
    ) -> Result<(), SimError> {
        for (corners, springs) in springs {
            let springs = on_axes(springs, self.layout.element.unknowns());
            let none = Mat::zeros(springs.nrows(), springs.ncols());
            self.change(corners.map(|v| VertexId(v as u32)), [springs, none])?;
        }
        self.flush(elements)
    }

    /// Makes all splits and merges since the last call, in one batch, after which K is the sum of
    /// `elements`. Where the maintainer refuses, another one takes its place, of K assembled afresh.
    ///
    /// Cost: the batch, and the matrix of each element around a vertex that is touched.
    /// # Errors
    /// [`SimError::Inverse`] if K can't be inverted, or what holds the inverse is lost.
    pub fn flush(&mut self, elements: &Elements<'_>) -> Result<(), SimError> {
        let count = take(&mut self.pending_count);
        if count == 0 {
            return Ok(());
        }
        let begin = Instant::now();
        self.updates += count;
        self.batches += 1;
        let (updates, touched) = (take(&mut self.pending), take(&mut self.touched));
        let rows = self.layout.rows(elements, touched)?;
        if let Err(cause) = self.maintainer.batch_to(&updates, &rows) {
            self.reassemble(cause, elements)?;
        }
        let before_ms = take(&mut self.pending_ms);
        let elapsed_ms = before_ms + begin.elapsed().as_secs_f64() * 1e3;
        self.update_ms.extend(std::iter::repeat_n(elapsed_ms / count as f64, count));
        self.total_ms += elapsed_ms;
        Ok(())
    }

    /// Lets the maintainer measure its drift from K, and rebuild if it has drifted too far; keeps the
    /// largest drift seen. Best after a [`flush`](Self::flush): K is true then.
    ///
    /// Drift comes of many updates: nothing is done until there were 16 since the last time.
    /// # Errors
    /// As [`flush`](Self::flush).
    pub fn watch(&mut self, seed: u64, elements: &Elements<'_>) -> Result<(), SimError> {
        if self.updates < self.watched + WATCH_EVERY {
            return Ok(());
        }
        self.watched = self.updates;
        let rebuilds = self.maintainer.counts().rebuilds;
        match self.maintainer.watch(seed) {
            Ok(drift) => self.drift_max = self.drift_max.max(drift),
            Err(cause) => self.reassemble(cause, elements)?,
        }
        if self.maintainer.counts().rebuilds > rebuilds {
            self.forget_held();
        }
        Ok(())
    }

    /// Counts and times so far.
    pub(crate) fn kept(&self) -> KeptInverse {
        let Counts { rebuilds, drift_rebuilds, failed_pivots, refinement_steps, .. } =
            self.counts();
        KeptInverse {
            updates: self.updates,
            watched: self.watched,
            batches: self.batches,
            reassemblies: self.reassemblies,
            drift_max: self.drift_max,
            counts: [rebuilds, drift_rebuilds, failed_pivots, refinement_steps],
            update_ms: self.update_ms.clone(),
            total_ms: self.total_ms,
        }
    }

    /// Numbers the slots of `vertices` anew and inverts the stiffness of `elements` afresh, with the anchor that
    /// it has; goes on from counts that were kept. Arguments are those of [`new`](Self::new).
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn renew(
        &mut self,
        kept: &KeptInverse,
        elements: &Elements<'_>,
        vertices: impl Iterator<Item = VertexId>,
        is_fixed: impl Fn(usize) -> bool,
        order_key: impl Fn(VertexId) -> u64,
    ) -> Result<(), SimError> {
        self.layout.number(vertices, is_fixed, order_key);
        self.maintainer = (self.factory)(self.layout.assemble(elements)?)?;
        self.forget_held();
        let KeptInverse { updates, watched, batches, reassemblies, drift_max, .. } = *kept;
        (self.updates, self.watched, self.batches) = (updates, watched, batches);
        (self.reassemblies, self.drift_max) = (reassemblies, drift_max);
        (self.update_ms, self.total_ms) = (kept.update_ms.clone(), kept.total_ms);
        self.earlier = Counts::default();
        let [rebuilds, drift_rebuilds, failed_pivots, refinement_steps] = kept.counts;
        (self.earlier.rebuilds, self.earlier.drift_rebuilds) = (rebuilds, drift_rebuilds);
        (self.earlier.failed_pivots, self.earlier.refinement_steps) =
            (failed_pivots, refinement_steps);
        Ok(())
    }

    /// A maintainer of K as its elements sum up to, in the place of one that has refused an update.
    fn reassemble(&mut self, cause: InverseError, elements: &Elements<'_>) -> Result<(), SimError> {
        let cause = match cause {
            InverseError::Batch { source, .. } => *source,
            other => other,
        };
        // What is lost with a device, another matrix does not bring back.
        if matches!(cause, InverseError::Storage { .. }) {
            return Err(cause.into());
        }
        tracing::warn!(%cause, "an update of the inverse was refused: K is assembled afresh");
        let maintainer = (self.factory)(self.layout.assemble(elements)?)?;
        self.earlier += self.maintainer.counts();
        self.maintainer = maintainer;
        self.reassemblies += 1;
        self.forget_held();
        Ok(())
    }

    /// The held vertices' columns are of an inverse before.
    fn forget_held(&mut self) {
        *self.held.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// The inverse with `held` vertices (not fixed ones) fixed as well.
    pub(crate) fn constrained(&self, held: &[usize]) -> Result<Constrained<'_>, SimError> {
        let slots: Vec<usize> = held.iter().filter_map(|&v| self.slot(v)).collect();
        let unknowns = self.layout.element.unknowns();
        let maintainer = self.maintainer.as_ref();
        let mut known = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let is_current = |known: &&Arc<Held>| known.updates == self.updates && known.slots == slots;
        let held = match known.as_ref().filter(is_current) {
            Some(held) => Arc::clone(held),
            None => Arc::new(Held::new(maintainer, unknowns, self.updates, slots)?),
        };
        *known = Some(Arc::clone(&held));
        Ok(Constrained { maintainer, slots: &self.layout.slots, unknowns, held })
    }
}

/// Springs on the corners of a tetrahedron, the same for each axis, in `m` unknowns per vertex.
fn on_axes(springs: &Matrix4<f64>, m: usize) -> Mat<f64> {
    let alike = |i: usize, j: usize| i % m == j % m && i % m < DISPLACEMENTS;
    let entry = |i, j| if alike(i, j) { springs[(i / m, j / m)] } else { 0.0 };
    Mat::from_fn(4 * m, 4 * m, entry)
}
