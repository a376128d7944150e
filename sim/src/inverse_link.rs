//! Between the mesh's vertices and the inverse's slots.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use faer::Mat;
use faer::linalg::solvers::{Llt, Solve};
use nalgebra::{DMatrix, Vector3};
use yawara_corot::Body;
use yawara_embed::{ElementFormulation, RingStiffness, clamp};
use yawara_inverse_update::{
    InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, Update,
};
use yawara_mesh::{Change, TetId, VertexId};

use crate::error::SimError;

/// Makes a maintainer of the inverse of a stiffness matrix.
pub type InverseFactory =
    Box<dyn Fn(SparseStiffness) -> Result<Box<dyn InverseMaintainer>, InverseError>>;

const NO_SLOT: usize = usize::MAX;

/// Displacements of a vertex, the first of its unknowns.
const DISPLACEMENTS: usize = 3;

/// The inverse with the map from vertices to its slots. Fixed vertices have none, unless their
/// element has more unknowns than displacements: those stay, and the displacements are clamped.
pub struct InverseLink {
    maintainer: Box<dyn InverseMaintainer>,
    element: Box<dyn ElementFormulation>,
    /// What holds clamped displacements, N/m.
    anchor: f64,
    slot_of: Vec<usize>,
    vertex_of: Vec<VertexId>,
    tools: Mutex<Option<Arc<Held>>>,
    /// What the maintainer has not been told yet, and since when it took how long.
    pending: Vec<Update>,
    pending_ms: f64,
    /// Splits and merges in there, those that leave K as it is included.
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
    /// `is_fixed` tells by vertex number whose displacements are fixed.
    /// `order_key` tells where a vertex lies, see [`SparseStiffness::set_order_keys`].
    ///
    /// # Errors
    /// [`SimError::Inverse`] if that stiffness is not (quasi-)definite.
    pub fn new(
        body: &Body,
        element: Box<dyn ElementFormulation>,
        vertices: impl Iterator<Item = VertexId>,
        is_fixed: impl Fn(usize) -> bool,
        order_key: impl Fn(VertexId) -> u64,
        factory: &InverseFactory,
    ) -> Result<Self, SimError> {
        Self::with_densities(body, &|_| 0.0, element, vertices, is_fixed, order_key, factory)
    }

    /// As [`new`](Self::new), for an element whose [matrix](ElementFormulation::matrix) has a mass;
    /// `density` by tetrahedron, kg/m³.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_densities(
        body: &Body,
        density: &dyn Fn(TetId) -> f64,
        element: Box<dyn ElementFormulation>,
        vertices: impl Iterator<Item = VertexId>,
        is_fixed: impl Fn(usize) -> bool,
        order_key: impl Fn(VertexId) -> u64,
        factory: &InverseFactory,
    ) -> Result<Self, SimError> {
        let vertex_of: Vec<VertexId> =
            vertices.filter(|v| needs_slot(element.as_ref(), is_fixed(v.index()))).collect();
        let capacity = body.elements().iter().flat_map(|e| e.vertices).max().map_or(0, |v| v + 1);
        let mut slot_of = vec![NO_SLOT; capacity];
        for (slot, v) in vertex_of.iter().enumerate() {
            if slot_of.len() <= v.index() {
                slot_of.resize(v.index() + 1, NO_SLOT);
            }
            slot_of[v.index()] = slot;
        }
        let m = element.unknowns();
        let mut stiffness =
            SparseStiffness::quasi_definite(vertex_of.len(), m, element.negative())?;
        let keys: Vec<u64> = vertex_of.iter().map(|&v| order_key(v)).collect();
        stiffness.set_order_keys(&keys)?;
        for tet in body.elements() {
            let slots = tet.vertices.map(|v| slot_of[v]);
            let kept: Vec<usize> = (0..4).filter(|&i| slots[i] != NO_SLOT).collect();
            let mut k = element.matrix(&tet.geometry, &tet.elasticity, density(tet.tet));
            clamp(&mut k, &tet.vertices.map(&is_fixed));
            let row = |i: usize| m * kept[i / m] + i % m;
            let rows = m * kept.len();
            let dense = Mat::from_fn(rows, rows, |i, j| k[(row(i), row(j))]);
            let slots: Vec<usize> = kept.iter().map(|&i| slots[i]).collect();
            stiffness.add(&slots, dense.as_ref())?;
        }
        let anchor = body.stiffness_scale();
        let held =
            Mat::from_fn(m, m, |i, j| if i == j && i < DISPLACEMENTS { anchor } else { 0.0 });
        for (slot, _) in vertex_of.iter().enumerate().filter(|(_, v)| is_fixed(v.index())) {
            stiffness.add(&[slot], held.as_ref())?;
        }
        Ok(Self {
            maintainer: factory(stiffness)?,
            element,
            anchor,
            slot_of,
            vertex_of,
            tools: Mutex::new(None),
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
        self.slot_of.get(vertex).copied().filter(|&s| s != NO_SLOT)
    }

    /// Takes a split or merge with the hand-over of [`element`](Self::element); `is_fixed` tells
    /// whose displacements are fixed, `order_key` where the vertex lies. [`flush`](Self::flush) makes
    /// it.
    pub fn push(
        &mut self,
        change: Change,
        vertex: VertexId,
        is_fixed: impl Fn(VertexId) -> bool,
        order_key: u64,
        ring: RingStiffness,
    ) {
        let begin = Instant::now();
        let has_slot = needs_slot(self.element.as_ref(), is_fixed(vertex));
        let ring = match self.element.unknowns() {
            DISPLACEMENTS if is_fixed(vertex) => ring.with_new_vertex_held(&is_fixed),
            DISPLACEMENTS => ring,
            _ => ring.clamp(&is_fixed, is_fixed(vertex), self.anchor),
        };
        let ring = in_slots(ring, order_key, |v| self.slot(v.index()));
        let update = match (has_slot, change) {
            (false, Change::Split) => stiffness_change(ring.slots, ring.positive, ring.negative),
            (false, Change::Merge) => stiffness_change(ring.slots, ring.negative, ring.positive),
            (true, Change::Split) => Some(self.split(vertex, ring)),
            (true, Change::Merge) => Some(self.merge(vertex, ring)),
        };
        self.pending.extend(update);
        self.pending_count += 1;
        self.pending_ms += begin.elapsed().as_secs_f64() * 1e3;
    }

    /// Makes all splits and merges that came in since the last time, in one batch.
    ///
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
        // That updates came together is nobody else's business.
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

    /// The new vertex takes the last slot.
    fn split(&mut self, vertex: VertexId, ring: RingChange) -> Update {
        if self.slot_of.len() <= vertex.index() {
            self.slot_of.resize(vertex.index() + 1, NO_SLOT);
        }
        self.slot_of[vertex.index()] = self.vertex_of.len();
        self.vertex_of.push(vertex);
        Update::Split(ring)
    }

    /// The last slot's vertex moves into the gap.
    fn merge(&mut self, vertex: VertexId, change: RingChange) -> Update {
        let slot = self.slot_of[vertex.index()];
        self.vertex_of.swap_remove(slot);
        if let Some(moved) = self.vertex_of.get(slot) {
            self.slot_of[moved.index()] = slot;
        }
        self.slot_of[vertex.index()] = NO_SLOT;
        Update::Merge { slot, change }
    }

    /// Has the maintainer look at a few random columns, and start afresh if they have drifted too
    /// far; renews the largest drift seen.
    pub(crate) fn watch(&mut self, seed: u64) -> Result<(), SimError> {
        let rebuilds = self.maintainer.counts().rebuilds;
        self.drift_max = self.drift_max.max(self.maintainer.watch(seed)?);
        if self.maintainer.counts().rebuilds > rebuilds {
            // What tools know is of the inverse before.
            *self.tools.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
        }
        Ok(())
    }

    /// The inverse with `held` vertices (not fixed ones) fixed as well.
    pub(crate) fn constrained(&self, held: &[usize]) -> Result<Constrained<'_>, SimError> {
        let slots: Vec<usize> = held.iter().filter_map(|&v| self.slot(v)).collect();
        let mut known = self.tools.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(tools) = known.as_ref()
            && tools.updates == self.updates
            && tools.slots == slots
        {
            return Ok(Constrained { link: self, tools: Arc::clone(tools) });
        }
        let tools = Arc::new(Held::new(self, slots)?);
        *known = Some(Arc::clone(&tools));
        Ok(Constrained { link: self, tools })
    }
}

/// What is known of the vertices that tools hold, until the mesh or the hold changes.
struct Held {
    updates: usize,
    slots: Vec<usize>,
    /// C_:p for the displacements p, where the maintainer has it at hand.
    columns: Option<Mat<f64>>,
    /// Of C_pp for the displacements p, positive definite even where pressures make C indefinite.
    factor: Llt<f64>,
}

impl Held {
    fn new(link: &InverseLink, slots: Vec<usize>) -> Result<Self, SimError> {
        let maintainer = link.maintainer.as_ref();
        let m = link.element.unknowns();
        let n = DISPLACEMENTS * slots.len();
        // Of a slot's unknowns the displacements.
        let of = |i: usize| m * (i / DISPLACEMENTS) + i % DISPLACEMENTS;
        let (columns, block) = if maintainer.holds_columns() {
            let all = maintainer.columns(&slots)?;
            let row = |i: usize| m * slots[i / DISPLACEMENTS] + i % DISPLACEMENTS;
            let block = Mat::from_fn(n, n, |i, j| all[(row(i), of(j))]);
            let columns = match m {
                DISPLACEMENTS => all,
                _ => Mat::from_fn(all.nrows(), n, |i, j| all[(i, of(j))]),
            };
            (Some(columns), block)
        } else {
            let all = maintainer.compliance(&slots)?;
            (None, Mat::from_fn(n, n, |i, j| all[(of(i), of(j))]))
        };
        let factor = Llt::new(block.as_ref(), faer::Side::Lower)
            .map_err(|_| SimError::ComplianceNotPositive { vertices: slots.len() })?;
        Ok(Self { updates: link.updates, slots, columns, factor })
    }
}

/// K⁻¹ with some vertices held: C − C_:p C_pp⁻¹ C_p:.
pub(crate) struct Constrained<'a> {
    link: &'a InverseLink,
    tools: Arc<Held>,
}

impl Constrained<'_> {
    fn unknowns(&self) -> usize {
        self.link.element.unknowns()
    }

    /// y = C f by vertex number (the element's unknowns each), displacements zero on held and fixed
    /// vertices.
    pub fn apply(&self, f: &[f64], y: &mut [f64]) -> Result<(), SimError> {
        let m = self.unknowns();
        let n = m * self.link.vertex_of.len();
        let mut local = vec![0.0; n];
        for (slot, v) in self.link.vertex_of.iter().enumerate() {
            let at = m * v.index();
            local[m * slot..m * slot + m].copy_from_slice(&f[at..at + m]);
        }
        let mut solution = vec![0.0; n];
        self.link.maintainer.solve(&local, &mut solution)?;
        let slots = &self.tools.slots;
        if !slots.is_empty() {
            let at_held =
                Mat::from_fn(3 * slots.len(), 1, |i, _| solution[m * slots[i / 3] + i % 3]);
            self.subtract_columns(&self.tools.factor.solve(&at_held), &mut solution)?;
            for &slot in slots {
                solution[m * slot..m * slot + DISPLACEMENTS].fill(0.0);
            }
        }
        self.scatter(&solution, y);
        Ok(())
    }

    /// The unknowns that moving the held vertices by `moves` (in the order of `held`)
    /// drags along in the unrotated linear body: C_:p C_pp⁻¹ moves, by vertex number.
    pub fn drag(&self, moves: &[Vector3<f64>], y: &mut [f64]) -> Result<(), SimError> {
        let rhs = Mat::from_fn(3 * self.tools.slots.len(), 1, |i, _| moves[i / 3][i % 3]);
        let mut solution = vec![0.0; self.unknowns() * self.link.vertex_of.len()];
        self.subtract_columns(&(-self.tools.factor.solve(&rhs)), &mut solution)?;
        self.scatter(&solution, y);
        Ok(())
    }

    /// C_pp⁻¹ on the held displacements in the order of `held`, N/m.
    pub fn stiffness(&self) -> DMatrix<f64> {
        let n = DISPLACEMENTS * self.tools.slots.len();
        let inverse = self.tools.factor.solve(Mat::<f64>::identity(n, n));
        DMatrix::from_fn(n, n, |i, j| inverse[(i, j)])
    }

    /// target ← target − C_:p weights.
    fn subtract_columns(&self, weights: &Mat<f64>, target: &mut [f64]) -> Result<(), SimError> {
        if let Some(columns) = &self.tools.columns {
            for j in 0..columns.ncols() {
                let weight = weights[(j, 0)];
                for (t, c) in target.iter_mut().zip(columns.col(j).iter()) {
                    *t -= weight * c;
                }
            }
            return Ok(());
        }
        let m = self.unknowns();
        let mut load = vec![0.0; target.len()];
        for (i, &slot) in self.tools.slots.iter().enumerate() {
            for a in 0..3 {
                load[m * slot + a] = weights[(3 * i + a, 0)];
            }
        }
        let mut product = vec![0.0; target.len()];
        self.link.maintainer.solve(&load, &mut product)?;
        for (t, p) in target.iter_mut().zip(&product) {
            *t -= p;
        }
        Ok(())
    }

    fn scatter(&self, local: &[f64], y: &mut [f64]) {
        let m = self.unknowns();
        y.fill(0.0);
        for (slot, v) in self.link.vertex_of.iter().enumerate() {
            let at = m * v.index();
            y[at..at + m].copy_from_slice(&local[m * slot..m * slot + m]);
        }
    }
}

/// The ring of a vertex without unknowns: what the children are stiffer or softer, if anything.
fn stiffness_change(slots: Vec<usize>, added: Mat<f64>, removed: Mat<f64>) -> Option<Update> {
    let is_change = !slots.is_empty() && added.ncols() + removed.ncols() > 0;
    is_change.then_some(Update::Content(StiffnessChange { slots, added, removed }))
}

/// Whether a vertex has unknowns: a fixed one that has displacements alone has none.
fn needs_slot(element: &dyn ElementFormulation, is_fixed: bool) -> bool {
    !is_fixed || element.unknowns() > DISPLACEMENTS
}

/// The hand-over of a ring whose vertices have slots.
fn in_slots(
    ring: RingStiffness,
    order_key: u64,
    slot: impl Fn(VertexId) -> Option<usize>,
) -> RingChange {
    let RingStiffness { vertices, k_p, k_c, a12, a22, b, positive, negative } =
        ring.restricted(|v| slot(v).is_some());
    let slots = vertices.into_iter().filter_map(slot).collect();
    RingChange { slots, k_p, k_c, a12, a22, b, positive, negative, order_key }
}
