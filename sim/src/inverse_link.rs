//! Between the mesh's vertices and the inverse's slots.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use faer::Mat;
use faer::linalg::solvers::{Llt, Solve};
use nalgebra::Vector3;
use yawara_corot::Body;
use yawara_embed::RingStiffness;
use yawara_inverse_update::{
    InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange,
};
use yawara_mesh::{Change, VertexId};

use crate::error::SimError;

/// Makes a maintainer of the inverse of a stiffness matrix.
pub type InverseFactory =
    Box<dyn Fn(SparseStiffness) -> Result<Box<dyn InverseMaintainer>, InverseError>>;

const NO_SLOT: usize = usize::MAX;

/// The inverse with the map from vertices to its slots; fixed vertices have none.
pub struct InverseLink {
    maintainer: Box<dyn InverseMaintainer>,
    slot_of: Vec<usize>,
    vertex_of: Vec<VertexId>,
    tools: Mutex<Option<Arc<Held>>>,
    pub(crate) update_ms: Vec<f64>,
    pub(crate) updates: usize,
    pub(crate) drift_max: f64,
}

impl InverseLink {
    /// Assembles the stiffness of `body` on the vertices that are not fixed and inverts it.
    ///
    /// `order_key` tells where a vertex lies, see [`SparseStiffness::set_order_keys`].
    ///
    /// # Errors
    /// [`SimError::Inverse`] if that stiffness is not positive definite.
    pub fn new(
        body: &Body,
        free_vertices: Vec<VertexId>,
        vertex_capacity: usize,
        order_key: impl Fn(VertexId) -> u64,
        factory: &InverseFactory,
    ) -> Result<Self, SimError> {
        let mut slot_of = vec![NO_SLOT; vertex_capacity];
        for (slot, v) in free_vertices.iter().enumerate() {
            slot_of[v.index()] = slot;
        }
        let mut stiffness = SparseStiffness::zeros(free_vertices.len(), 3)?;
        let keys: Vec<u64> = free_vertices.iter().map(|&v| order_key(v)).collect();
        stiffness.set_order_keys(&keys)?;
        for element in body.elements() {
            let slots = element.vertices.map(|v| slot_of[v]);
            let kept: Vec<usize> = (0..4).filter(|&i| slots[i] != NO_SLOT).collect();
            let k = element.geometry.stiffness(&element.elasticity);
            let rows = 3 * kept.len();
            let dense = Mat::from_fn(rows, rows, |i, j| {
                k[(3 * kept[i / 3] + i % 3, 3 * kept[j / 3] + j % 3)]
            });
            let slots: Vec<usize> = kept.iter().map(|&i| slots[i]).collect();
            stiffness.add(&slots, dense.as_ref())?;
        }
        Ok(Self {
            maintainer: factory(stiffness)?,
            slot_of,
            vertex_of: free_vertices,
            tools: Mutex::new(None),
            update_ms: Vec::new(),
            updates: 0,
            drift_max: 0.0,
        })
    }

    /// The maintainer.
    pub fn maintainer(&self) -> &dyn InverseMaintainer {
        self.maintainer.as_ref()
    }

    /// Slot of a vertex, if it is not fixed.
    pub fn slot(&self, vertex: usize) -> Option<usize> {
        self.slot_of.get(vertex).copied().filter(|&s| s != NO_SLOT)
    }

    /// Takes a split or merge; `vertex_is_fixed` tells whether the vertex has no slot, `order_key`
    /// where it lies.
    ///
    /// # Errors
    /// [`SimError::Inverse`] if the maintainer refuses the change.
    pub fn apply(
        &mut self,
        change: Change,
        vertex: VertexId,
        vertex_is_fixed: bool,
        order_key: u64,
        ring: &RingStiffness,
    ) -> Result<(), SimError> {
        let begin = Instant::now();
        let reduced = ReducedRing::new(ring, order_key, |v| self.slot(v.index()));
        match (vertex_is_fixed, change) {
            (true, Change::Split) => self.change(&reduced, &reduced.positive, &reduced.negative)?,
            (true, Change::Merge) => self.change(&reduced, &reduced.negative, &reduced.positive)?,
            (false, Change::Split) => self.split(vertex, reduced)?,
            (false, Change::Merge) => self.merge(vertex, reduced)?,
        }
        self.updates += 1;
        self.update_ms.push(begin.elapsed().as_secs_f64() * 1e3);
        Ok(())
    }

    fn change(
        &mut self,
        ring: &ReducedRing,
        added: &Mat<f64>,
        removed: &Mat<f64>,
    ) -> Result<(), SimError> {
        if ring.slots.is_empty() || added.ncols() + removed.ncols() == 0 {
            return Ok(());
        }
        let (slots, added, removed) = (ring.slots.clone(), added.clone(), removed.clone());
        Ok(self.maintainer.change(&StiffnessChange { slots, added, removed })?)
    }

    fn split(&mut self, vertex: VertexId, mut ring: ReducedRing) -> Result<(), SimError> {
        if ring.negative.ncols() > 0 {
            self.change(&ring, &ring.positive, &ring.negative)?;
            ring.absorb_excess();
        }
        let slot = self.maintainer.split(&ring.into_change())?;
        if self.slot_of.len() <= vertex.index() {
            self.slot_of.resize(vertex.index() + 1, NO_SLOT);
        }
        self.slot_of[vertex.index()] = slot;
        self.vertex_of.push(vertex);
        Ok(())
    }

    fn merge(&mut self, vertex: VertexId, ring: ReducedRing) -> Result<(), SimError> {
        let slot = self.slot_of[vertex.index()];
        if ring.negative.ncols() > 0 {
            let mut conforming = ring.clone();
            conforming.absorb_excess();
            self.remove(slot, vertex, &conforming.into_change())?;
            let moved = ReducedRing { slots: self.slots_again(&ring), ..ring };
            return self.change(&moved, &moved.negative, &moved.positive);
        }
        self.remove(slot, vertex, &ring.into_change())
    }

    fn remove(
        &mut self,
        slot: usize,
        vertex: VertexId,
        change: &RingChange,
    ) -> Result<(), SimError> {
        self.maintainer.merge(slot, change)?;
        self.vertex_of.swap_remove(slot);
        if let Some(moved) = self.vertex_of.get(slot) {
            self.slot_of[moved.index()] = slot;
        }
        self.slot_of[vertex.index()] = NO_SLOT;
        Ok(())
    }

    fn slots_again(&self, ring: &ReducedRing) -> Vec<usize> {
        ring.vertices.iter().map(|v| self.slot_of[v.index()]).collect()
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
    /// C_:p, where the maintainer has it at hand.
    columns: Option<Mat<f64>>,
    /// Of C_pp.
    factor: Llt<f64>,
}

impl Held {
    fn new(link: &InverseLink, slots: Vec<usize>) -> Result<Self, SimError> {
        let maintainer = link.maintainer.as_ref();
        let (columns, block) = if maintainer.holds_columns() {
            let columns = maintainer.columns(&slots)?;
            let row = |i: usize| 3 * slots[i / 3] + i % 3;
            let n = columns.ncols();
            let block = Mat::from_fn(n, n, |i, j| columns[(row(i), j)]);
            (Some(columns), block)
        } else {
            (None, maintainer.compliance(&slots)?)
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
    /// y = C f by vertex number (3 entries each), zero on held and fixed vertices.
    pub fn apply(&self, f: &[f64], y: &mut [f64]) -> Result<(), SimError> {
        let n = 3 * self.link.vertex_of.len();
        let mut local = vec![0.0; n];
        for (slot, v) in self.link.vertex_of.iter().enumerate() {
            local[3 * slot..3 * slot + 3].copy_from_slice(&f[3 * v.index()..3 * v.index() + 3]);
        }
        let mut solution = vec![0.0; n];
        self.link.maintainer.solve(&local, &mut solution)?;
        let slots = &self.tools.slots;
        if !slots.is_empty() {
            let at_held =
                Mat::from_fn(3 * slots.len(), 1, |i, _| solution[3 * slots[i / 3] + i % 3]);
            self.subtract_columns(&self.tools.factor.solve(&at_held), &mut solution)?;
            for &slot in slots {
                solution[3 * slot..3 * slot + 3].fill(0.0);
            }
        }
        self.scatter(&solution, y);
        Ok(())
    }

    /// The displacements that moving the held vertices by `moves` (in the order of `held`)
    /// drags along in the unrotated linear body: C_:p C_pp⁻¹ moves, by vertex number.
    pub fn drag(&self, moves: &[Vector3<f64>], y: &mut [f64]) -> Result<(), SimError> {
        let rhs = Mat::from_fn(3 * self.tools.slots.len(), 1, |i, _| moves[i / 3][i % 3]);
        let mut solution = vec![0.0; 3 * self.link.vertex_of.len()];
        self.subtract_columns(&(-self.tools.factor.solve(&rhs)), &mut solution)?;
        self.scatter(&solution, y);
        Ok(())
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
        let mut load = vec![0.0; target.len()];
        for (i, &slot) in self.tools.slots.iter().enumerate() {
            for a in 0..3 {
                load[3 * slot + a] = weights[(3 * i + a, 0)];
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
        y.fill(0.0);
        for (slot, v) in self.link.vertex_of.iter().enumerate() {
            y[3 * v.index()..3 * v.index() + 3].copy_from_slice(&local[3 * slot..3 * slot + 3]);
        }
    }
}

/// A [`RingStiffness`] on the vertices that have slots.
#[derive(Clone)]
struct ReducedRing {
    slots: Vec<usize>,
    vertices: Vec<VertexId>,
    k_p: Mat<f64>,
    k_c: Mat<f64>,
    a12: Mat<f64>,
    a22: Mat<f64>,
    b: Mat<f64>,
    positive: Mat<f64>,
    negative: Mat<f64>,
    order_key: u64,
}

impl ReducedRing {
    fn new(ring: &RingStiffness, order_key: u64, slot: impl Fn(VertexId) -> Option<usize>) -> Self {
        let kept: Vec<usize> =
            (0..ring.vertices.len()).filter(|&i| slot(ring.vertices[i]).is_some()).collect();
        let row = |i: usize| 3 * kept[i / 3] + i % 3;
        let n = 3 * kept.len();
        let rows = |m: &Mat<f64>| Mat::from_fn(n, m.ncols(), |i, j| m[(row(i), j)]);
        let square = |m: &Mat<f64>| Mat::from_fn(n, n, |i, j| m[(row(i), row(j))]);
        Self {
            vertices: kept.iter().map(|&i| ring.vertices[i]).collect(),
            slots: kept.iter().filter_map(|&i| slot(ring.vertices[i])).collect(),
            k_p: square(&ring.k_p),
            k_c: square(&ring.k_c),
            a12: rows(&ring.a12),
            a22: ring.a22.clone(),
            b: rows(&ring.b),
            positive: rows(&ring.positive),
            negative: rows(&ring.negative),
            order_key,
        }
    }

    /// Moves the excess F Fᵀ − N Nᵀ into the coarse ring, which is then conforming.
    fn absorb_excess(&mut self) {
        self.k_p += &self.positive * self.positive.transpose();
        self.k_p -= &self.negative * self.negative.transpose();
        self.positive = Mat::zeros(self.positive.nrows(), 0);
        self.negative = Mat::zeros(self.negative.nrows(), 0);
    }

    fn into_change(self) -> RingChange {
        RingChange {
            slots: self.slots,
            k_p: self.k_p,
            k_c: self.k_c,
            a12: self.a12,
            a22: self.a22,
            b: self.b,
            positive: self.positive,
            order_key: self.order_key,
        }
    }
}
