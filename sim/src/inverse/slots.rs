//! Which vertex has which slot of the matrix.

use yawara_mesh::VertexId;

/// The map between vertices that have unknowns and the slots of the matrix, numbered as every
/// [`InverseMaintainer`](yawara_inverse_update::InverseMaintainer) numbers them: a new vertex takes
/// a new slot at the end, and when a vertex goes the last one moves into its slot.
///
/// Vertices without unknowns (fixed ones, mostly) have no slot. All operations on one vertex cost
/// O(1).
#[derive(Clone, Debug, Default)]
pub struct SlotMap {
    vertex_of: Vec<VertexId>,
    slot_of: Vec<Option<usize>>,
}

impl SlotMap {
    /// Slots 0, 1, 2 … for these vertices.
    pub fn new(vertices: impl IntoIterator<Item = VertexId>) -> Self {
        let mut slots = Self::default();
        for vertex in vertices {
            slots.push(vertex);
        }
        slots
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.vertex_of.len()
    }

    /// True without slots.
    pub fn is_empty(&self) -> bool {
        self.vertex_of.is_empty()
    }

    /// The vertices by slot.
    pub fn vertices(&self) -> &[VertexId] {
        &self.vertex_of
    }

    /// The slot of a vertex; none if it has no unknowns.
    pub fn get(&self, vertex: VertexId) -> Option<usize> {
        self.slot_of.get(vertex.index()).copied().flatten()
    }

    /// Gives a vertex without slot a new one at the end, which is returned.
    pub fn push(&mut self, vertex: VertexId) -> usize {
        let slot = self.vertex_of.len();
        self.vertex_of.push(vertex);
        if self.slot_of.len() <= vertex.index() {
            self.slot_of.resize(vertex.index() + 1, None);
        }
        self.slot_of[vertex.index()] = Some(slot);
        slot
    }

    /// Takes a vertex out: the last vertex moves into its slot, which is returned. None if the
    /// vertex had no slot.
    pub fn swap_remove(&mut self, vertex: VertexId) -> Option<usize> {
        let slot = self.slot_of.get_mut(vertex.index())?.take()?;
        self.vertex_of.swap_remove(slot);
        if let Some(moved) = self.vertex_of.get(slot) {
            self.slot_of[moved.index()] = Some(slot);
        }
        Some(slot)
    }

    /// Entries by vertex number, `unknowns` each, to entries by slot.
    ///
    /// Shapes: `by_vertex` unknowns · (largest vertex number + 1) or more; the result
    /// unknowns · [`len`](Self::len).
    pub fn gather(&self, unknowns: usize, by_vertex: &[f64]) -> Vec<f64> {
        let mut by_slot = Vec::with_capacity(unknowns * self.len());
        for v in &self.vertex_of {
            let at = unknowns * v.index();
            by_slot.extend_from_slice(&by_vertex[at..at + unknowns]);
        }
        by_slot
    }

    /// Entries by slot, `unknowns` each, to entries by vertex number; 0 where there is no slot.
    ///
    /// Shapes as in [`gather`](Self::gather).
    pub fn scatter(&self, unknowns: usize, by_slot: &[f64], by_vertex: &mut [f64]) {
        by_vertex.fill(0.0);
        for (v, entries) in self.vertex_of.iter().zip(by_slot.chunks_exact(unknowns)) {
            let at = unknowns * v.index();
            by_vertex[at..at + unknowns].copy_from_slice(entries);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_vertex_moves_into_the_gap() {
        let mut slots = SlotMap::new([7, 2, 9].map(VertexId));
        assert_eq!(slots.swap_remove(VertexId(7)), Some(0));
        assert_eq!(slots.get(VertexId(9)), Some(0));
        assert_eq!(slots.get(VertexId(7)), None);
        assert_eq!(slots.push(VertexId(4)), 2);
        assert_eq!(slots.swap_remove(VertexId(4)), Some(2));
        assert_eq!(slots.swap_remove(VertexId(4)), None);
        assert_eq!(slots.len(), 2);
    }

    #[test]
    fn gathering_undoes_scattering_and_leaves_vertices_without_slots_zero() {
        let slots = SlotMap::new([3, 1].map(VertexId));
        let by_slot = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut by_vertex = [9.0; 12];
        slots.scatter(3, &by_slot, &mut by_vertex);
        assert_eq!(by_vertex, [0., 0., 0., 4., 5., 6., 0., 0., 0., 1., 2., 3.]);
        assert_eq!(slots.gather(3, &by_vertex), by_slot);
    }
}
