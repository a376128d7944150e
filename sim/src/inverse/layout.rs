//! What it takes to sum K from the elements at any time: the unknowns, and what is fixed.

use yawara_corot::Body;
use yawara_embed::ElementFormulation;
use yawara_inverse_update::{FreshRows, InverseError, SparseStiffness};
use yawara_mesh::{TetId, VertexId};

use super::assembly::{Assembly, needs_slot};
use super::slots::SlotMap;

/// The elements that K is summed from.
pub struct Elements<'a> {
    /// All of them, with the springs that hold them.
    pub body: &'a Body,
    /// Density of a tetrahedron, kg/m³; asked where the element's
    /// [matrix](ElementFormulation::matrix) has a mass.
    pub density: &'a dyn Fn(TetId) -> f64,
}

/// Which unknowns there are, and what an element has of them.
pub(super) struct Layout {
    pub element: Box<dyn ElementFormulation>,
    /// Stiffness that holds fixed displacements which have rows, N/m.
    pub anchor: f64,
    pub slots: SlotMap,
    /// By vertex number whether its displacements are fixed.
    fixed: Vec<bool>,
    /// By vertex number where it lies.
    order_keys: Vec<u64>,
}

impl Layout {
    /// Without vertices.
    pub fn new(element: Box<dyn ElementFormulation>, anchor: f64) -> Self {
        let (slots, fixed, order_keys) = (SlotMap::default(), Vec::new(), Vec::new());
        Self { element, anchor, slots, fixed, order_keys }
    }

    /// Numbers the slots of `vertices`, all there are.
    pub fn number(
        &mut self,
        vertices: impl Iterator<Item = VertexId>,
        is_fixed: impl Fn(usize) -> bool,
        order_key: impl Fn(VertexId) -> u64,
    ) {
        self.slots = SlotMap::default();
        for v in vertices {
            if self.note(v, is_fixed(v.index()), order_key(v)) {
                self.slots.push(v);
            }
        }
    }

    /// Notes a vertex that comes in, or goes. Returns whether it has unknowns.
    pub fn note(&mut self, vertex: VertexId, is_fixed: bool, order_key: u64) -> bool {
        let at = vertex.index();
        if self.fixed.len() <= at {
            self.fixed.resize(at + 1, false);
            self.order_keys.resize(at + 1, 0);
        }
        (self.fixed[at], self.order_keys[at]) = (is_fixed, order_key);
        needs_slot(self.element.as_ref(), is_fixed)
    }

    pub fn is_fixed(&self, vertex: VertexId) -> bool {
        self.fixed[vertex.index()]
    }

    /// K as its elements sum up to.
    /// # Errors
    /// As [`Assembly::assemble`].
    pub fn assemble(&self, elements: &Elements<'_>) -> Result<SparseStiffness, InverseError> {
        let all = elements.body.elements();
        self.assembly(elements, |assembly| assembly.assemble(all, &self.slots))
    }

    /// Rows of the same, of those of some vertices that have a slot.
    /// # Errors
    /// As [`Assembly::rows`].
    pub fn rows(
        &self,
        elements: &Elements<'_>,
        vertices: Vec<VertexId>,
    ) -> Result<FreshRows, InverseError> {
        let all = elements.body.elements();
        self.assembly(elements, |assembly| assembly.rows(all, &self.slots, vertices))
    }

    fn assembly<T>(&self, elements: &Elements<'_>, make: impl FnOnce(&Assembly<'_>) -> T) -> T {
        make(&Assembly {
            element: self.element.as_ref(),
            is_fixed: &|v| self.is_fixed(v),
            anchor: self.anchor,
            density: elements.density,
            springs: &|tet| elements.body.grip_matrix(tet),
            order_key: &|v| self.order_keys[v.index()],
        })
    }
}
