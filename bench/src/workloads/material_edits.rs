//! Changes of the stiffness that bring no vertex in or out: tetrahedra made stiffer, and back.

use yawara::inverse::SlotMap;
use yawara_corot::Element;
use yawara_embed::{ContentStiffness, ElementFormulation, P1};
use yawara_inverse_update::{SparseStiffness, StiffnessChange};
use yawara_mesh::VertexId;

use crate::bodies::organ::Organ;
use crate::error::Result;
use crate::workloads::random::SplitMix64;

/// At most so many tetrahedra are stiffer than their material at a time.
const MOST: usize = 32;

/// Tetrahedra of the start mesh, whose vertices stay.
pub(crate) struct MaterialEdits {
    elements: Vec<Element>,
    /// Elements that are stiffer now, and by which part of their stiffness.
    active: Vec<(usize, f64)>,
}

impl MaterialEdits {
    /// None is stiffer yet.
    pub fn new(organ: &Organ, homogenisation: &str) -> Result<Self> {
        let embedding = organ.embedding(homogenisation)?;
        Ok(Self { elements: organ.body(&embedding).elements().to_vec(), active: Vec::new() })
    }

    /// Makes a random tetrahedron stiffer by up to its own stiffness, or takes that back from one.
    /// Rank 6. None where the chosen one has no free vertex.
    pub fn step(
        &mut self,
        slots: &SlotMap,
        random: &mut SplitMix64,
    ) -> Result<Option<StiffnessChange>> {
        let back = match self.active.len() {
            0 => false,
            MOST => true,
            _ => random.below(2) == 0,
        };
        if back {
            let (element, part) = self.active.swap_remove(random.below(self.active.len()));
            return self.change(element, [part, 0.0], slots);
        }
        let (element, part) = (random.below(self.elements.len()), random.symmetric().abs());
        let change = self.change(element, [0.0, part], slots)?;
        self.active.extend(change.is_some().then_some((element, part)));
        Ok(change)
    }

    /// Adds what is stiffer now to a freshly assembled K.
    pub fn add_to(&self, stiffness: &mut SparseStiffness, slots: &SlotMap) -> Result<()> {
        for &(element, part) in &self.active {
            if let Some(change) = self.change(element, [0.0, part], slots)? {
                stiffness.change(&change)?;
            }
        }
        Ok(())
    }

    /// An element that was stiffer by one part of its stiffness and is so by another.
    fn change(
        &self,
        element: usize,
        parts: [f64; 2],
        slots: &SlotMap,
    ) -> Result<Option<StiffnessChange>> {
        let Element { vertices, geometry, elasticity, .. } = self.elements[element];
        let vertices = vertices.map(|v| VertexId(v as u32));
        let matrices = parts.map(|part| P1.stiffness(&geometry, &(elasticity * (1.0 + part))));
        Ok(slots.content_change(&ContentStiffness::new(vertices, [false; 4], matrices)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::organ::Size;
    use crate::workloads::history::History;
    use faer::Mat;

    #[test]
    fn changes_add_up_to_what_is_assembled_and_stay_within_twice_the_stiffness() {
        let organ = Organ::new(Size::Quick).unwrap();
        let history = History::new(&organ, "laminate", 0, 1).unwrap();
        let mut edits = MaterialEdits::new(&organ, "laminate").unwrap();
        let mut random = SplitMix64(3);
        let mut kept = history.stiffness().unwrap();
        let mut back = 0;
        for _ in 0..200 {
            let Some(change) = edits.step(history.slots(), &mut random).unwrap() else { continue };
            back += usize::from(change.removed.ncols() > 0);
            kept.change(&change).unwrap();
        }
        assert!(back > 50 && !edits.active.is_empty() && edits.active.len() <= MOST);
        let mut fresh = history.stiffness().unwrap();
        let start = fresh.clone();
        edits.add_to(&mut fresh, history.slots()).unwrap();
        let largest = |of: &dyn Fn(usize) -> f64| (0..fresh.dofs()).map(of).fold(0.0, f64::max);
        let worst = largest(&|i| (kept.diagonal(i) / fresh.diagonal(i) - 1.0).abs());
        let moved = largest(&|i| fresh.diagonal(i) / start.diagonal(i) - 1.0);
        // 200 changes of a few terms each; an element's own part is changed by a factor below 2.
        assert!(worst < 200.0 * 10.0 * f64::EPSILON, "{worst:e}");
        assert!(moved > 0.01, "{moved}");
    }

    #[test]
    fn a_step_adds_a_part_of_the_element_s_stiffness_and_takes_it_back() {
        let organ = Organ::new(Size::Quick).unwrap();
        let slots = SlotMap::new(organ.forest.vertices());
        let mut edits = MaterialEdits::new(&organ, "linear").unwrap();
        let mut random = SplitMix64(1);
        let change = edits.step(&slots, &mut random).unwrap().unwrap();
        let (element, part) = edits.active[0];
        assert!(part > 0.0 && part < 1.0);
        let Element { geometry, elasticity, .. } = &edits.elements[element];
        let k = geometry.stiffness(elasticity);
        let want = Mat::from_fn(12, 12, |i, j| part * k[(i, j)]);
        // Rounding is that of 1 + part times the stiffness.
        let scale = k.norm();
        assert!((change.delta() - &want).norm_l2() < 1e-13 * scale);
        assert_eq!((change.added.ncols(), change.removed.ncols()), (6, 0));
        let mut sum = change.delta();
        while !edits.active.is_empty() {
            let first = edits.active.iter().any(|active| active.0 == element);
            let change = edits.step(&slots, &mut random).unwrap().unwrap();
            if first && edits.active.iter().all(|active| active.0 != element) {
                sum += change.delta();
            }
        }
        assert!(sum.norm_l2() < 1e-13 * scale);
    }
}
