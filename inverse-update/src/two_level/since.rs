//! What has become of a matrix.

use crate::change::UpdateRef;

/// No slot, no index.
pub(super) const NONE: u32 = u32::MAX;

/// How the vertices of K now are those of K as it was, and whose rows are others.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Since {
    /// The slot that each vertex had, [`NONE`] for one that is new.
    pub before: Vec<u32>,
    /// By slot now, whether its row has changed.
    pub is_changed: Vec<bool>,
}

impl Since {
    /// As it was.
    pub fn start(vertices: usize) -> Self {
        Self { before: (0..vertices as u32).collect(), is_changed: vec![false; vertices] }
    }

    /// Takes an update that K can take.
    pub fn follow(&mut self, update: UpdateRef<'_>) {
        for &slot in update.slots() {
            self.is_changed[slot] = true;
        }
        match update {
            UpdateRef::Split(_) => {
                self.before.push(NONE);
                self.is_changed.push(true);
            }
            UpdateRef::Merge(slot, _) => {
                self.before.swap_remove(slot);
                self.is_changed.swap_remove(slot);
            }
            UpdateRef::Content(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RingChange;
    use faer::mat;

    #[test]
    fn vertices_keep_their_slots_of_before() {
        let ring = |slots| RingChange::freed(slots, mat![[-1.0]], mat![[1.0]], 0).unwrap();
        let mut since = Since::start(4);
        since.follow(UpdateRef::Split(&ring(vec![1])));
        since.follow(UpdateRef::Merge(0, &ring(vec![2])));
        // The new vertex has moved into the slot of the one that is gone.
        let want = Since { before: vec![NONE, 1, 2, 3], is_changed: vec![true, true, true, false] };
        assert_eq!(since, want);
    }
}
