//! What an update does to the factor: in slots, so that it can be replayed on a factor with another
//! elimination order.

use std::iter::repeat_n;

use faer::{Mat, MatRef};

use super::bennett::Scratch;
use super::factor::{Factor, NONE, Panel};
use super::pivot::{BadPivot, Pivot, by_rows, square};
use crate::InverseError;
use crate::change::{Capacitance, UpdateRef, beside, pivoted};

/// U Σ Uᵀ on the rows of some slots, Σ = diag(`signs`).
#[derive(Debug, Clone)]
pub(crate) struct SlotChange {
    pub slots: Vec<usize>,
    pub columns: Mat<f64>,
    pub signs: Vec<f64>,
}

/// One change of the matrix, as the factor needs it.
#[derive(Debug, Clone)]
pub(crate) enum Edit {
    /// The old rows change by M; the new vertex comes with L = a12 A22⁻¹ and D = A22.
    Split {
        old: SlotChange,
        lower: Mat<f64>,
        own: Mat<f64>,
    },
    /// The reverse: the old rows change by −M, and by −a12 A22⁻¹ a12ᵀ where a vertex of the ring is
    /// eliminated before the one that is removed.
    Merge {
        slot: usize,
        old: SlotChange,
        border: SlotChange,
    },
    Change(SlotChange),
}

impl SlotChange {
    fn new(slots: &[usize], parts: &[(MatRef<'_, f64>, f64)]) -> Self {
        let matrices: Vec<MatRef<'_, f64>> = parts.iter().map(|part| part.0).collect();
        let signs = |&(part, sign): &(MatRef<'_, f64>, f64)| repeat_n(sign, part.ncols());
        let signs = parts.iter().flat_map(signs).collect();
        Self { slots: slots.to_vec(), columns: beside(&matrices), signs }
    }

    /// The same U Σ Uᵀ with as few columns as it takes, after what cancels has cancelled.
    ///
    /// Where a ring joins stiff and soft tissue, U may be stiff and U Σ Uᵀ soft; a walk with such
    /// columns would make the factor stiffer and softer again, which costs as many digits as they
    /// differ in. The rows are scaled to equal size first, so that soft ones keep their digits.
    /// Nothing is done without rows or if all signs are equal. Cost: that of
    /// [`pivoted`].
    fn compressed(self) -> Self {
        let is_one_signed = self.signs.windows(2).all(|pair| pair[0] == pair[1]);
        if self.columns.nrows() == 0 || is_one_signed {
            return self;
        }
        match pivoted(self.columns.as_ref(), &self.signs) {
            Ok((columns, signs)) => Self { columns, signs, ..self },
            Err(_) => self,
        }
    }
}

impl Edit {
    /// # Errors
    /// [`InverseError::Singular`] if the ring's own algebra fails.
    pub(crate) fn of(update: UpdateRef<'_>, negative: usize) -> Result<Self, InverseError> {
        let change = match update {
            UpdateRef::Split(change) | UpdateRef::Merge(_, change) => change,
            UpdateRef::Content(change) => {
                let parts = [(change.added.as_ref(), 1.0), (change.removed.as_ref(), -1.0)];
                return Ok(Self::Change(SlotChange::new(&change.slots, &parts).compressed()));
            }
        };
        let (slots, own) = (&change.slots, &change.a22);
        let a22 = Capacitance::of("a22", own.as_ref(), negative)?;
        let (more, less) = (change.positive.as_ref(), change.negative.as_ref());
        let released = a22.half_solve(change.b.as_ref());
        let positive = own.nrows() - negative;
        let (lost, gained) = released.split_at_col(positive);
        let Some(slot) = update.removed() else {
            let parts = [(more, 1.0), (gained, 1.0), (lost, -1.0), (less, -1.0)];
            return Ok(Self::Split {
                old: SlotChange::new(slots, &parts).compressed(),
                lower: a22.solve(change.a12.as_ref()),
                own: Mat::from_fn(own.nrows(), own.ncols(), |i, j| {
                    0.5 * own[(i, j)] + 0.5 * own[(j, i)]
                }),
            });
        };
        let parts = [(lost, 1.0), (less, 1.0), (gained, -1.0), (more, -1.0)];
        let border = a22.half_solve(change.a12.as_ref());
        let (goes, comes) = border.split_at_col(positive);
        Ok(Self::Merge {
            slot,
            old: SlotChange::new(slots, &parts).compressed(),
            border: SlotChange::new(slots, &[(goes, -1.0), (comes, 1.0)]),
        })
    }
}

impl Factor {
    /// # Errors
    /// [`BadPivot`]; the factor is damaged then.
    pub(crate) fn apply(&mut self, edit: &Edit, scratch: &mut Scratch) -> Result<(), BadPivot> {
        match edit {
            Edit::Change(change) => self.change(change, scratch),
            Edit::Split { old, lower, own } => {
                self.change(old, scratch)?;
                by_rows!(self.block, M => self.insert::<M>(&old.slots, lower, own))
            }
            Edit::Merge { slot, old, border } => {
                let own = self.position_of[*slot];
                if old.slots.iter().all(|&other| self.position_of[other] < own) {
                    let old = self.after_removal(*slot, old);
                    self.remove(*slot);
                    return self.change(&old, scratch);
                }
                let whole = by_rows!(self.block, M => self.released::<M>(*slot, [old, border]));
                let whole = self.after_removal(*slot, &whole).compressed();
                self.remove(*slot);
                self.change(&whole, scratch)
            }
        }
    }

    fn change(&mut self, change: &SlotChange, scratch: &mut Scratch) -> Result<(), BadPivot> {
        let positions: Vec<u32> = change.slots.iter().map(|&slot| self.position_of[slot]).collect();
        self.update(&positions, change.columns.as_ref(), &change.signs, scratch)
    }

    /// The same change in the slots as they are once `slot` is gone.
    fn after_removal(&self, slot: usize, change: &SlotChange) -> SlotChange {
        let mut change = change.clone();
        let last = self.vertices() - 1;
        change.slots.iter_mut().filter(|other| **other == last).for_each(|other| *other = slot);
        change
    }

    /// The new vertex's column.
    fn insert<const M: usize>(
        &mut self,
        slots: &[usize],
        lower: &Mat<f64>,
        own: &Mat<f64>,
    ) -> Result<(), BadPivot> {
        let low = self.positions();
        let coupled = |at: &usize| (0..M).any(|a| (0..M).any(|b| lower[(M * at + a, b)] != 0.0));
        let kept: Vec<usize> = (0..slots.len()).filter(coupled).collect();
        let rows = kept.iter().map(|&at| self.position_of[slots[at]]).collect();
        let mut panel = Panel::zeros(low, 1, rows, M);
        for b in 0..M {
            for (row, &at) in kept.iter().enumerate() {
                for a in 0..M {
                    panel.values[panel.stride * b + M * (row + 1) + a] = lower[(M * at + a, b)];
                }
            }
            for a in 0..M {
                panel.diagonal[M * a + b] = own[(a, b)];
            }
        }
        let floor = std::array::from_fn(|a| f64::EPSILON * own[(a, a)].abs());
        let pivot = Pivot::<M>::new(&square(&panel.diagonal), &floor, self.negative, low)?;
        pivot.write(&mut panel.pivots);
        self.push(panel);
        Ok(())
    }

    /// Two changes on the same rows, and what the elimination of a vertex has subtracted from the
    /// others: l D lᵀ of its own column.
    fn released<const M: usize>(&self, slot: usize, changes: [&SlotChange; 2]) -> SlotChange {
        let position = self.position_of[slot] as usize;
        let panel = &self.panels[self.panel_of[position] as usize];
        let local = panel.local(position);
        let mut slots = changes[0].slots.clone();
        let mut place = Vec::new();
        for row in panel.positions_from(local + 1) {
            let slot = self.slot_of[row];
            let at = slots.iter().position(|&other| other == slot as usize);
            // A row of the panel whose vertex is gone holds zeros.
            place.push((slot != NONE).then(|| at.unwrap_or(slots.len())));
            if at.is_none() && slot != NONE {
                slots.push(slot as usize);
            }
        }
        let counts = changes.map(|change| change.signs.len());
        let mut columns = Mat::zeros(M * slots.len(), counts[0] + counts[1] + M);
        let mut signs = Vec::with_capacity(columns.ncols());
        for change in changes {
            let (rows, count) = change.columns.shape();
            columns.as_mut().submatrix_mut(0, signs.len(), rows, count).copy_from(&change.columns);
            signs.extend_from_slice(&change.signs);
        }
        let first = signs.len();
        let half = Pivot::<M>::read(&panel.pivots[M * M * local..M * M * (local + 1)]).half();
        for (at, place) in place.iter().enumerate() {
            let Some(place) = place else { continue };
            for a in 0..M {
                let row = M * (local + 1 + at) + a;
                let l: [f64; M] =
                    std::array::from_fn(|b| panel.values[panel.stride * (M * local + b) + row]);
                for j in 0..M {
                    columns[(M * place + a, first + j)] = (0..M).map(|b| l[b] * half[b][j]).sum();
                }
            }
        }
        signs.extend((0..M).map(|j| if j + self.negative < M { 1.0 } else { -1.0 }));
        SlotChange { slots, columns, signs }
    }
}
