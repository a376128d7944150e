//! A split, a merge or a change of content as an update of the inverse.

use faer::Mat;
use yawara_embed::{ContentStiffness, RingStiffness};
use yawara_inverse_update::{RingChange, StiffnessChange, Update};
use yawara_mesh::{Change, VertexId};

use super::DISPLACEMENTS;
use super::slots::SlotMap;

/// A ring's hand-over with the displacements of fixed vertices held, for `unknowns` per vertex.
///
/// `new_is_fixed` tells about the vertex that is split or merged, `is_fixed` about the others.
/// `anchor` (N/m) holds fixed displacements where vertices keep other unknowns, as in
/// [`Assembly::anchor`](super::Assembly::anchor). Cost: O(r) for a ring of r vertices.
pub fn hold(
    ring: RingStiffness,
    unknowns: usize,
    new_is_fixed: bool,
    is_fixed: impl Fn(VertexId) -> bool,
    anchor: f64,
) -> RingStiffness {
    match unknowns {
        DISPLACEMENTS if new_is_fixed => ring.with_new_vertex_held(is_fixed),
        DISPLACEMENTS => ring,
        _ => ring.clamp(is_fixed, new_is_fixed, anchor),
    }
}

impl SlotMap {
    /// The hand-over of a ring on those of its vertices that have slots.
    ///
    /// The slots are those before a split and before a merge. Cost: a copy of the ring's matrices.
    pub fn ring_change(&self, ring: RingStiffness, order_key: u64) -> RingChange {
        let RingStiffness { vertices, k_p, k_c, a12, a22, b, positive, negative } =
            ring.restricted(|v| self.get(v).is_some());
        let slots = vertices.into_iter().filter_map(|v| self.get(v)).collect();
        RingChange { slots, k_p, k_c, a12, a22, b, positive, negative, order_key }
    }

    /// Makes a split or merge of `vertex` here, and returns what the maintainer has to make of it.
    ///
    /// `has_unknowns` tells whether the vertex has, or is to have, a slot. One without brings no
    /// vertex in or out: it is a change of the stiffness alone, or none at all (`None`).
    /// `ring` is as [`hold`] leaves it; `order_key` tells where the vertex lies.
    /// # Panics
    /// If a vertex with unknowns is merged that has no slot.
    pub fn update(
        &mut self,
        change: Change,
        vertex: VertexId,
        has_unknowns: bool,
        ring: RingStiffness,
        order_key: u64,
    ) -> Option<Update> {
        let ring = self.ring_change(ring, order_key);
        match (has_unknowns, change) {
            (false, Change::Split) => {
                stiffness_change(ring.slots, ring.positive, ring.negative).map(Update::Content)
            }
            (false, Change::Merge) => {
                stiffness_change(ring.slots, ring.negative, ring.positive).map(Update::Content)
            }
            (true, Change::Split) => {
                self.push(vertex);
                Some(Update::Split(ring))
            }
            (true, Change::Merge) => {
                let slot = self.swap_remove(vertex).expect("a merged vertex with unknowns");
                Some(Update::Merge { slot, change: ring })
            }
        }
    }

    /// The hand-over of a changed leaf on those of its vertices that have slots, if anything of it
    /// is left there.
    pub fn content_change(&self, content: &ContentStiffness) -> Option<StiffnessChange> {
        let ContentStiffness { vertices, added, removed } = content;
        let m = added.nrows() / vertices.len();
        let kept: Vec<usize> = (0..4).filter(|&i| self.get(vertices[i]).is_some()).collect();
        let rows = |part: &Mat<f64>| {
            Mat::from_fn(m * kept.len(), part.ncols(), |i, j| part[(m * kept[i / m] + i % m, j)])
        };
        let slots = kept.iter().filter_map(|&i| self.get(vertices[i])).collect();
        stiffness_change(slots, rows(added), rows(removed))
    }
}

/// A change of K in which no vertex comes or goes, if it is one.
fn stiffness_change(
    slots: Vec<usize>,
    added: Mat<f64>,
    removed: Mat<f64>,
) -> Option<StiffnessChange> {
    let is_change = !slots.is_empty() && added.ncols() + removed.ncols() > 0;
    is_change.then_some(StiffnessChange { slots, added, removed })
}
