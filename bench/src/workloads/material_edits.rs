//! Changes of the stiffness that bring no vertex in or out: tetrahedra made stiffer, and back.

use faer::Mat;
use yawara::inverse::SlotMap;
use yawara_inverse_update::{SparseStiffness, StiffnessChange};
use yawara_mesh::VertexId;

use crate::bodies::organ::Organ;
use crate::error::BenchError;
use crate::workloads::random::SplitMix64;

/// At most so many tetrahedra are stiffer than their material at a time.
const MOST: usize = 32;

/// Tetrahedra of the start mesh, whose vertices stay; each with the factor F of its stiffness,
/// K_e = F Fᵀ, 12 × 6, (N/m)^½.
#[derive(Clone, Debug)]
pub struct MaterialEdits {
    elements: Vec<([VertexId; 4], Mat<f64>)>,
    /// Elements that are stiffer now, and by which part of K_e.
    active: Vec<(usize, f64)>,
}

impl MaterialEdits {
    /// None is stiffer yet.
    ///
    /// # Errors
    /// [`BenchError::Embed`] from the homogenisation.
    pub fn new(organ: &Organ, homogenisation: &str) -> Result<Self, BenchError> {
        let embedding = organ.embedding(homogenisation)?;
        let body = organ.body(&embedding);
        let mut elements = Vec::new();
        for element in body.elements() {
            // An elasticity that is not positive definite was refused with its material.
            let Some(d) = element.elasticity.cholesky() else { continue };
            let factor = element.geometry.strain_matrix().transpose()
                * d.l()
                * element.geometry.volume.sqrt();
            let vertices = element.vertices.map(|v| VertexId(v as u32));
            elements.push((vertices, Mat::from_fn(12, 6, |i, j| factor[(i, j)])));
        }
        Ok(Self { elements, active: Vec::new() })
    }

    /// Makes a random tetrahedron stiffer by up to its own stiffness, or takes that back from one.
    /// Rank 6. None where the chosen one has no free vertex.
    pub(crate) fn step(
        &mut self,
        slots: &SlotMap,
        random: &mut SplitMix64,
    ) -> Option<StiffnessChange> {
        let back = match self.active.len() {
            0 => false,
            MOST => true,
            _ => random.below(2) == 0,
        };
        let (element, part) = if back {
            self.active.swap_remove(random.below(self.active.len()))
        } else {
            let added = (random.below(self.elements.len()), random.symmetric().abs());
            self.elements[added.0].0.iter().find(|&&v| slots.get(v).is_some())?;
            self.active.push(added);
            added
        };
        let (slots, factor) = self.factor(element, part, slots);
        let none = Mat::zeros(factor.nrows(), 0);
        let (added, removed) = if back { (none, factor) } else { (factor, none) };
        Some(StiffnessChange { slots, added, removed })
    }

    /// Adds what is stiffer now to a freshly assembled K.
    ///
    /// # Errors
    /// [`BenchError::Inverse`] if an element's stiffness is not finite.
    pub fn add_to(
        &self,
        stiffness: &mut SparseStiffness,
        slots: &SlotMap,
    ) -> Result<(), BenchError> {
        for &(element, part) in &self.active {
            let (slots, factor) = self.factor(element, part, slots);
            stiffness.add(&slots, (&factor * factor.transpose()).as_ref())?;
        }
        Ok(())
    }

    /// √part F on the free vertices of an element, and their slots.
    fn factor(&self, element: usize, part: f64, slots: &SlotMap) -> (Vec<usize>, Mat<f64>) {
        let (vertices, factor) = &self.elements[element];
        let kept: Vec<usize> = (0..4).filter(|&i| slots.get(vertices[i]).is_some()).collect();
        let row = |i: usize| 3 * kept[i / 3] + i % 3;
        let root = part.sqrt();
        let scaled = Mat::from_fn(3 * kept.len(), 6, |i, j| root * factor[(row(i), j)]);
        (kept.iter().filter_map(|&i| slots.get(vertices[i])).collect(), scaled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::organ::Size;
    use crate::workloads::history::History;

    #[test]
    fn changes_add_up_to_what_is_assembled_and_stay_within_twice_the_stiffness() {
        let organ = Organ::new(Size::Quick).unwrap();
        let history = History::new(&organ, "laminate", 0, 1).unwrap();
        let mut edits = MaterialEdits::new(&organ, "laminate").unwrap();
        let mut random = SplitMix64(3);
        let mut kept = history.stiffness().unwrap();
        let mut back = 0;
        for _ in 0..200 {
            let Some(change) = edits.step(history.slots(), &mut random) else { continue };
            back += usize::from(change.removed.ncols() > 0);
            kept.change(&change).unwrap();
        }
        assert!(back > 50 && !edits.active.is_empty() && edits.active.len() <= MOST);
        let mut fresh = history.stiffness().unwrap();
        let start = fresh.clone();
        edits.add_to(&mut fresh, history.slots()).unwrap();
        let (mut worst, mut moved) = (0.0f64, 0.0f64);
        for i in 0..fresh.dofs() {
            worst = worst.max((kept.diagonal(i) / fresh.diagonal(i) - 1.0).abs());
            moved = moved.max(fresh.diagonal(i) / start.diagonal(i) - 1.0);
        }
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
        let change = edits.step(&slots, &mut random).unwrap();
        let (element, part) = edits.active[0];
        assert!(part > 0.0 && part < 1.0);
        let factor = &edits.elements[element].1;
        let want = Mat::from_fn(12, 12, |i, j| {
            part * (0..6).map(|k| factor[(i, k)] * factor[(j, k)]).sum::<f64>()
        });
        assert!((change.delta() - &want).norm_l2() < 1e-14 * want.norm_l2());
        let mut sum = change.delta();
        while !edits.active.is_empty() {
            let first = edits.active.iter().any(|active| active.0 == element);
            let change = edits.step(&slots, &mut random).unwrap();
            if first && edits.active.iter().all(|active| active.0 != element) {
                sum += change.delta();
            }
        }
        assert!(sum.norm_l2() < 1e-14 * want.norm_l2());
    }

    #[test]
    fn a_factor_is_that_of_the_element_s_stiffness() {
        let organ = Organ::new(Size::Quick).unwrap();
        let edits = MaterialEdits::new(&organ, "linear").unwrap();
        let embedding = organ.embedding("linear").unwrap();
        let body = organ.body(&embedding);
        let element = &body.elements()[5];
        let k = element.geometry.stiffness(&element.elasticity);
        let square = &edits.elements[5].1 * edits.elements[5].1.transpose();
        for i in 0..12 {
            for j in 0..12 {
                assert!((square[(i, j)] - k[(i, j)]).abs() < 1e-13 * k.norm());
            }
        }
    }
}
