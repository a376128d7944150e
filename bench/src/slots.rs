//! Which slot of the inverse holds which vertex.

use nalgebra::Vector3;
use yawara_mesh::VertexId;

/// The map between free vertices and slots, kept as the maintainers keep theirs: a new vertex
/// takes the last slot, the last one moves into a gap.
#[derive(Clone, Debug, Default)]
pub struct Slots {
    vertex_of: Vec<VertexId>,
    slot_of: Vec<Option<usize>>,
}

impl Slots {
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

    /// The slot of a vertex; none if it is fixed.
    pub fn get(&self, vertex: VertexId) -> Option<usize> {
        self.slot_of.get(vertex.index()).copied().flatten()
    }

    /// Gives a vertex the last slot, which is returned.
    pub fn push(&mut self, vertex: VertexId) -> usize {
        let slot = self.vertex_of.len();
        self.vertex_of.push(vertex);
        if self.slot_of.len() <= vertex.index() {
            self.slot_of.resize(vertex.index() + 1, None);
        }
        self.slot_of[vertex.index()] = Some(slot);
        slot
    }

    /// Takes a vertex out; the last one moves into its slot, which is returned.
    pub fn swap_remove(&mut self, vertex: VertexId) -> Option<usize> {
        let slot = self.slot_of.get_mut(vertex.index())?.take()?;
        self.vertex_of.swap_remove(slot);
        if let Some(moved) = self.vertex_of.get(slot) {
            self.slot_of[moved.index()] = Some(slot);
        }
        Some(slot)
    }

    /// Values by vertex number to 3 entries per slot.
    pub fn gather(&self, by_vertex: &[Vector3<f64>]) -> Vec<f64> {
        self.vertex_of.iter().flat_map(|v| <[f64; 3]>::from(by_vertex[v.index()])).collect()
    }

    /// 3 entries per slot to 3 entries per vertex number, 0 where there is no slot.
    ///
    /// Shapes: `by_slot` 3 · len(), `by_vertex` 3 · (largest vertex number + 1) or more.
    pub fn scatter(&self, by_slot: &[f64], by_vertex: &mut [f64]) {
        by_vertex.fill(0.0);
        for (v, entries) in self.vertex_of.iter().zip(by_slot.chunks_exact(3)) {
            by_vertex[3 * v.index()..3 * v.index() + 3].copy_from_slice(entries);
        }
    }

    /// 3 entries per vertex number to 3 entries per slot.
    pub fn select(&self, by_vertex: &[f64], by_slot: &mut [f64]) {
        for (v, entries) in self.vertex_of.iter().zip(by_slot.chunks_exact_mut(3)) {
            entries.copy_from_slice(&by_vertex[3 * v.index()..3 * v.index() + 3]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_vertex_moves_into_the_gap() {
        let mut slots = Slots::new([7, 2, 9].map(VertexId));
        assert_eq!(slots.swap_remove(VertexId(7)), Some(0));
        assert_eq!(slots.get(VertexId(9)), Some(0));
        assert_eq!(slots.get(VertexId(7)), None);
        assert_eq!(slots.push(VertexId(4)), 2);
        assert_eq!(slots.swap_remove(VertexId(4)), Some(2));
        assert_eq!(slots.swap_remove(VertexId(4)), None);
        assert_eq!(slots.len(), 2);
    }

    #[test]
    fn select_undoes_scatter_and_leaves_fixed_vertices_zero() {
        let slots = Slots::new([3, 1].map(VertexId));
        let by_slot = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut by_vertex = [9.0; 12];
        slots.scatter(&by_slot, &mut by_vertex);
        assert_eq!(by_vertex, [0., 0., 0., 4., 5., 6., 0., 0., 0., 1., 2., 3.]);
        let mut back = [0.0; 6];
        slots.select(&by_vertex, &mut back);
        assert_eq!(back, by_slot);
    }
}
