//! Updates of the sparse stiffness itself: checked, then applied.

use faer::{Mat, MatRef};

use super::batch::{StiffnessChange, Update, UpdateRef};
use super::ring_change::{CONSISTENCY_LIMIT, RingChange};
use crate::InverseError;
use crate::matrix::{FreshRows, SparseStiffness, check_slots, scaled_difference};

impl SparseStiffness {
    /// K becomes [K + K_c − K_p, a12; a12ᵀ, A22]; the new vertex has the last slot.
    ///
    /// Blocks that cancel to rounding (the ends of the bisected edge) are dropped.
    /// Cost: O(ring²) blocks.
    /// # Errors
    /// As [`RingChange::check`], and on overflow; K is then unchanged.
    pub fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.check_and_apply(UpdateRef::Split(change))?;
        Ok(self.vertices() - 1)
    }

    /// The reverse of [`split`](Self::split): the vertex at `slot` goes and the last one
    /// takes its slot. Returns the slot that was moved, if any.
    ///
    /// Cost: O(ring²) blocks.
    /// # Errors
    /// As [`RingChange::check`]; also if `slot` is not one, is in its own ring, is coupled to
    /// anything else, or if a12, A22 are not what is stored. K is then unchanged.
    pub fn merge(
        &mut self,
        slot: usize,
        change: &RingChange,
    ) -> Result<Option<usize>, InverseError> {
        self.check_and_apply(UpdateRef::Merge(slot, change))?;
        Ok(self.moved_into(slot))
    }

    /// K ← K + A Aᵀ − B Bᵀ on existing vertices.
    /// # Errors
    /// As [`StiffnessChange::check`], and on overflow; K is then unchanged.
    pub fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.check_and_apply(UpdateRef::Content(change))
    }

    /// Makes one update of any kind.
    /// # Errors
    /// Those of [`split`](Self::split), [`merge`](Self::merge) and [`change`](Self::change).
    pub fn update(&mut self, update: &Update) -> Result<(), InverseError> {
        self.check_and_apply(update.borrowed())
    }

    /// Lets vertices come and go as by updates, and takes the rows that these lead to from elsewhere.
    ///
    /// Cost: O(blocks of the rows), that of the updates' own matrices not included.
    /// # Errors
    /// [`InverseError::Slot`] for a merge of what is not there; those of [`refresh`](Self::refresh). K is
    /// spoilt then.
    pub(crate) fn arrange(
        &mut self,
        updates: &[Update],
        rows: &FreshRows,
    ) -> Result<(), InverseError> {
        let m = self.block();
        for update in updates {
            match update {
                Update::Split(change) => {
                    let (none, own) = (Mat::zeros(0, m), Mat::zeros(m, m));
                    self.append(&[], none.as_ref(), own.as_ref(), change.order_key);
                }
                Update::Merge { slot, .. } => {
                    check_slots(&[*slot], self.vertices())?;
                    self.swap_remove(*slot);
                }
                Update::Content(_) => {}
            }
        }
        self.refresh(rows)
    }

    fn check_and_apply(&mut self, update: UpdateRef<'_>) -> Result<(), InverseError> {
        self.check(update)?;
        self.apply_update(update);
        Ok(())
    }

    /// Whether K can take an update.
    pub(crate) fn check(&self, update: UpdateRef<'_>) -> Result<(), InverseError> {
        let (vertices, block) = (self.vertices(), self.block());
        match update {
            UpdateRef::Split(change) => {
                change.check(vertices, block, self.negative())?;
                self.check_replace(&change.slots, change.k_p.as_ref(), change.k_c.as_ref())
            }
            UpdateRef::Merge(slot, change) => self.check_merge(slot, change),
            UpdateRef::Content(change) => {
                change.check(vertices, block)?;
                let delta = change.delta();
                let none = Mat::<f64>::zeros(delta.nrows(), delta.ncols());
                self.check_replace(&change.slots, none.as_ref(), delta.as_ref())
            }
        }
    }

    /// Makes an update that has passed [`check`](Self::check).
    pub(crate) fn apply_update(&mut self, update: UpdateRef<'_>) {
        match update {
            UpdateRef::Split(change) => {
                self.replace(&change.slots, change.k_p.as_ref(), change.k_c.as_ref());
                let (coupling, own) = (change.a12.as_ref(), change.a22.as_ref());
                self.append(&change.slots, coupling, own, change.order_key);
            }
            UpdateRef::Merge(slot, change) => {
                self.replace(&change.slots, change.k_c.as_ref(), change.k_p.as_ref());
                self.swap_remove(slot);
            }
            UpdateRef::Content(change) => {
                let delta = change.delta();
                let none = Mat::<f64>::zeros(delta.nrows(), delta.ncols());
                self.replace(&change.slots, none.as_ref(), delta.as_ref());
            }
        }
    }

    /// The slot that the last vertex had before the vertex at `slot` went, unless it was that one.
    pub(crate) fn moved_into(&self, slot: usize) -> Option<usize> {
        let last = self.vertices();
        (slot != last).then_some(last)
    }

    fn check_merge(&self, slot: usize, change: &RingChange) -> Result<(), InverseError> {
        check_slots(&[slot], self.vertices())?;
        if change.slots.contains(&slot) {
            return Err(InverseError::OwnRing(slot));
        }
        change.check(self.vertices(), self.block(), self.negative())?;
        let nothing = Mat::<f64>::zeros(self.block(), self.block());
        for &other in self.neighbours(slot) {
            let outside = other != slot && !change.slots.contains(&other);
            // A block may have outlived its elements as rounding: its size decides.
            if outside && self.row_error(slot, &[other], nothing.as_ref()) > CONSISTENCY_LIMIT {
                return Err(InverseError::NotInRing { slot, other });
            }
        }
        self.check_row("the stored row of the vertex and a22", slot, &[slot], change.a22.as_ref())?;
        let what = "the stored row of the vertex and a12";
        self.check_row(what, slot, &change.slots, change.a12.as_ref())?;
        self.check_replace(&change.slots, change.k_c.as_ref(), change.k_p.as_ref())
    }

    fn check_row(
        &self,
        what: &'static str,
        slot: usize,
        slots: &[usize],
        claimed: MatRef<'_, f64>,
    ) -> Result<(), InverseError> {
        let error = self.row_error(slot, slots, claimed);
        // Not `error > limit`: a NaN has to be refused.
        if error <= CONSISTENCY_LIMIT {
            return Ok(());
        }
        Err(InverseError::Inconsistent { what, error, limit: CONSISTENCY_LIMIT })
    }

    /// How far the stored coupling of `slots` (rows) to `slot` is from what is claimed, relative
    /// to the diagonal.
    fn row_error(&self, slot: usize, slots: &[usize], claimed: MatRef<'_, f64>) -> f64 {
        let m = self.block();
        let stored = Mat::from_fn(m * slots.len(), m, |i, j| {
            self.block_at(slots[i / m], slot).map_or(0.0, |value| value[m * (i % m) + j])
        });
        let rows: Vec<f64> =
            (0..m * slots.len()).map(|i| self.diagonal(m * slots[i / m] + i % m).abs()).collect();
        let own: Vec<f64> = (0..m).map(|j| self.diagonal(m * slot + j).abs()).collect();
        scaled_difference(stored.as_ref(), claimed, &rows, &own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;

    /// Springs of stiffness 1 from a wall to vertex 0 and on to vertex 1.
    fn two_springs() -> SparseStiffness {
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        k.add(&[0], mat![[1.0]].as_ref()).unwrap();
        k.add(&[0, 1], mat![[1.0, -1.0], [-1.0, 1.0]].as_ref()).unwrap();
        k
    }

    /// The spring between them becomes two of stiffness 2 in a row.
    fn halved_spring() -> RingChange {
        let no_elements =
            RingChange::freed(vec![0, 1], mat![[-2.0], [-2.0]], mat![[4.0]], 0).unwrap();
        RingChange {
            k_p: mat![[1.0, -1.0], [-1.0, 1.0]],
            k_c: mat![[2.0, 0.0], [0.0, 2.0]],
            b: mat![[0.0], [0.0]],
            ..no_elements
        }
    }

    #[test]
    fn a_halved_spring_is_the_chain_by_hand() {
        let mut k = two_springs();
        assert_eq!(k.split(&halved_spring()), Ok(2));
        let chain = mat![[3.0, 0.0, -2.0], [0.0, 2.0, -2.0], [-2.0, -2.0, 4.0]];
        assert_eq!(k.to_dense(), chain);
        // The ends of the bisected edge no longer share an element: no block is kept for them.
        assert_eq!(k.neighbours(0), [0, 2]);
        assert_eq!(k.merge(2, &halved_spring()), Ok(None));
        assert_eq!(k.to_dense(), two_springs().to_dense());
    }

    #[test]
    fn a_soft_coupling_survives_next_to_a_stiff_one() {
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        let stiff = 1e9;
        let spring = |s: f64| mat![[s, -s], [-s, s]];
        k.add(&[0, 1], spring(stiff + 1.0).as_ref()).unwrap();
        let mut change = halved_spring();
        change.k_p = spring(stiff);
        change.k_c = mat![[2.0 * stiff, 0.0], [0.0, 2.0 * stiff]];
        change.a12 = mat![[-2.0 * stiff], [-2.0 * stiff]];
        change.a22 = mat![[4.0 * stiff]];
        k.split(&change).unwrap();
        assert_eq!(k.block_at(0, 1), Some(&[-1.0][..]));
    }

    #[test]
    fn an_overflow_is_refused_and_leaves_k() {
        let mut k = two_springs();
        let huge = mat![[1.7e308]];
        k.add(&[1], huge.as_ref()).unwrap();
        let before = k.to_dense();
        assert!(matches!(k.add(&[1], huge.as_ref()), Err(InverseError::NotFinite { .. })));
        assert_eq!(k.to_dense(), before);
    }

    #[test]
    fn apply_is_the_dense_product() {
        let k = two_springs();
        let mut f = [0.0; 2];
        k.apply(&[3.0, 5.0], &mut f).unwrap();
        assert_eq!(f, [1.0, 2.0]);
        assert!(k.apply(&[3.0, f64::NAN], &mut f).is_err());
        assert!(k.apply(&[3.0], &mut f).is_err());
        assert_eq!((k.diagonal(0), k.diagonal(1)), (2.0, 1.0));
    }
}
