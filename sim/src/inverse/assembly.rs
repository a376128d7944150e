//! The matrix that the inverse is of, from the elements of a body.

use std::borrow::Borrow;

use faer::Mat;
use nalgebra::Matrix4;
use yawara_corot::Element;
use yawara_embed::{ElementFormulation, clamp};
use yawara_inverse_update::{FreshRows, InverseError, SparseStiffness};
use yawara_mesh::{TetId, VertexId};

use super::DISPLACEMENTS;
use super::slots::SlotMap;

/// How elements become one matrix.
///
/// A vertex whose displacements are fixed has no unknowns and no slot, unless the formulation has
/// more unknowns than displacements (`p1p1`: a pressure). Such a vertex keeps its slot; the rows and
/// columns of its displacements are zero but for [`anchor`](Self::anchor) on the diagonal.
pub struct Assembly<'a> {
    /// The unknowns of a vertex and the matrix of an element.
    pub element: &'a dyn ElementFormulation,
    /// Whether the displacements of a vertex are fixed.
    pub is_fixed: &'a dyn Fn(VertexId) -> bool,
    /// Stiffness that holds fixed displacements which have rows, N/m; positive, best as large as
    /// the others ([`Body::stiffness_scale`](yawara_corot::Body::stiffness_scale)).
    pub anchor: f64,
    /// Density of a tetrahedron, kg/m³; asked where the element's matrix has a mass.
    pub density: &'a dyn Fn(TetId) -> f64,
    /// What holds a tetrahedron's material besides, on its corners and the same for each axis, N/m.
    pub springs: &'a dyn Fn(TetId) -> Option<Matrix4<f64>>,
    /// Where a vertex lies, for the elimination order
    /// ([`SparseStiffness::set_order_keys`]).
    pub order_key: &'a dyn Fn(VertexId) -> u64,
}

impl<'a> Assembly<'a> {
    /// For elements without mass that nothing else holds, anchored by 1 N/m.
    pub fn new(
        element: &'a dyn ElementFormulation,
        is_fixed: &'a dyn Fn(VertexId) -> bool,
        order_key: &'a dyn Fn(VertexId) -> u64,
    ) -> Self {
        let (density, springs) = (&|_| 0.0, &|_| None);
        Self { element, is_fixed, anchor: 1.0, density, springs, order_key }
    }

    /// Slots 0, 1, 2 … for those of `vertices` that have unknowns.
    pub fn slots(&self, vertices: impl IntoIterator<Item = VertexId>) -> SlotMap {
        let vertices = vertices.into_iter();
        SlotMap::new(vertices.filter(|&v| needs_slot(self.element, (self.is_fixed)(v))))
    }

    /// Σ of the elements' matrices, in the order of `slots`.
    ///
    /// Shapes: m · `slots.len()` rows for m unknowns per vertex, vertex-major. N/m. Cost: an
    /// element's matrix and its addition for each element; O(elements) memory for the result.
    /// # Errors
    /// [`InverseError`] if an element's matrix is not finite, or not symmetric.
    pub fn assemble(
        &self,
        elements: impl IntoIterator<Item = impl Borrow<Element>>,
        slots: &SlotMap,
    ) -> Result<SparseStiffness, InverseError> {
        let m = self.element.unknowns();
        let negative = self.element.negative();
        let mut stiffness = SparseStiffness::quasi_definite(slots.len(), m, negative)?;
        let keys: Vec<u64> = slots.vertices().iter().map(|&v| (self.order_key)(v)).collect();
        stiffness.set_order_keys(&keys)?;
        for element in elements {
            let (slots, dense) = self.matrix(element.borrow(), slots);
            stiffness.add(&slots, dense.as_ref())?;
        }
        for (slot, _) in slots.vertices().iter().enumerate().filter(|(_, v)| (self.is_fixed)(**v)) {
            stiffness.add(&[slot], self.anchoring().as_ref())?;
        }
        Ok(stiffness)
    }

    /// The rows of some vertices as [`assemble`](Self::assemble) has them, of all elements too.
    ///
    /// Cost: an element's matrix for each element that has one of the vertices.
    /// # Errors
    /// [`InverseError`] if an element's matrix has a wrong shape.
    pub fn rows(
        &self,
        elements: impl IntoIterator<Item = impl Borrow<Element>>,
        slots: &SlotMap,
        vertices: impl IntoIterator<Item = VertexId>,
    ) -> Result<FreshRows, InverseError> {
        let mut wanted: Vec<usize> = vertices.into_iter().filter_map(|v| slots.get(v)).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let is_fixed = |slot: &usize| (self.is_fixed)(slots.vertices()[*slot]);
        let fixed: Vec<usize> = wanted.iter().copied().filter(is_fixed).collect();
        let mut rows = FreshRows::new(slots.len(), self.element.unknowns(), wanted)?;
        let has = |rows: &FreshRows, v: usize| {
            slots.get(VertexId(v as u32)).is_some_and(|slot| rows.has(slot))
        };
        for element in elements {
            let element = element.borrow();
            if element.vertices.iter().any(|&v| has(&rows, v)) {
                let (slots, dense) = self.matrix(element, slots);
                rows.add(&slots, dense.as_ref())?;
            }
        }
        for slot in fixed {
            rows.add(&[slot], self.anchoring().as_ref())?;
        }
        Ok(rows)
    }

    /// What holds fixed displacements of a vertex that has rows.
    fn anchoring(&self) -> Mat<f64> {
        let m = self.element.unknowns();
        let is_displacement = |i: usize, j: usize| i == j && i < DISPLACEMENTS;
        Mat::from_fn(m, m, |i, j| if is_displacement(i, j) { self.anchor } else { 0.0 })
    }

    /// The slots of an element's corners that have one, and its matrix there.
    fn matrix(&self, element: &Element, slots: &SlotMap) -> (Vec<usize>, Mat<f64>) {
        let vertices = element.vertices.map(|v| VertexId(v as u32));
        let density = (self.density)(element.tet);
        let mut k = self.element.matrix(&element.geometry, &element.elasticity, density);
        let m = self.element.unknowns();
        if let Some(springs) = (self.springs)(element.tet) {
            for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
                (0..DISPLACEMENTS).for_each(|a| k[(m * i + a, m * j + a)] += springs[(i, j)]);
            }
        }
        clamp(&mut k, &vertices.map(self.is_fixed));
        let slot_of = vertices.map(|v| slots.get(v));
        let kept: Vec<usize> = (0..4).filter(|&i| slot_of[i].is_some()).collect();
        if kept.len() < 4 {
            let (row, rows) = (|i: usize| m * kept[i / m] + i % m, m * kept.len());
            k = Mat::from_fn(rows, rows, |i, j| k[(row(i), row(j))]);
        }
        (slot_of.into_iter().flatten().collect(), k)
    }
}

/// Whether a vertex has unknowns: a fixed one that has displacements alone has none.
pub(super) fn needs_slot(element: &dyn ElementFormulation, is_fixed: bool) -> bool {
    !is_fixed || element.unknowns() > DISPLACEMENTS
}
