//! What a split, a merge or a change does to the factor: in slots, so that it can be replayed on
//! a factor of another order.

use faer::{Mat, MatRef, Side};

use super::bennett::Scratch;
use super::factor::{Factor, Panel};
use super::pivot::{BadPivot, Pivot, square};
use crate::capacitance::Capacitance;
use crate::{InverseError, RingChange, StiffnessChange};

/// U Σ Uᵀ on the rows of some slots, Σ = diag(`signs`).
#[derive(Debug, Clone)]
pub(crate) struct LowRank {
    pub slots: Vec<usize>,
    pub columns: Mat<f64>,
    pub signs: Vec<f64>,
}

/// One change of the matrix, as the factor needs it.
#[derive(Debug, Clone)]
pub(crate) enum Edit {
    /// The old rows change by M; the new vertex comes with L = a12 A22⁻¹ and D = A22.
    Split {
        old: LowRank,
        lower: Mat<f64>,
        own: Mat<f64>,
    },
    /// The reverse: the old rows change by −M, and by −a12 A22⁻¹ a12ᵀ where the elimination of
    /// the vertex did not begin with its own row.
    Merge {
        slot: usize,
        old: LowRank,
        border: LowRank,
    },
    Change(LowRank),
}

impl LowRank {
    fn new(slots: &[usize], parts: &[(MatRef<'_, f64>, f64)]) -> Self {
        let rows = parts.first().map_or(0, |(part, _)| part.nrows());
        let count = parts.iter().map(|(part, _)| part.ncols()).sum();
        let (mut columns, mut signs) = (Mat::zeros(rows, count), Vec::with_capacity(count));
        for &(part, sign) in parts {
            let (first, count) = (signs.len(), part.ncols());
            columns.as_mut().submatrix_mut(0, first, rows, count).copy_from(part);
            signs.extend(std::iter::repeat_n(sign, count));
        }
        Self { slots: slots.to_vec(), columns, signs }
    }
}

impl LowRank {
    /// The same U Σ Uᵀ with as few columns as it takes, after what cancels has cancelled.
    ///
    /// Where a ring joins stiff and soft tissue, U may be stiff and U Σ Uᵀ soft; walking with such
    /// columns would harden the factor and soften it again, which costs as many digits as they
    /// differ in. The rows are scaled to equal size first, so that soft ones keep their digits.
    /// Nothing is done without rows or if all signs are equal. Cost: O((rows + k) k²) for k
    /// columns.
    fn compressed(self) -> Self {
        let (rows, count) = self.columns.shape();
        if rows == 0 || self.signs.windows(2).all(|pair| pair[0] == pair[1]) {
            return self;
        }
        let size = |i: usize| self.columns.row(i).norm_l2();
        let scale: Vec<f64> =
            (0..rows).map(|i| if size(i) > 0.0 { size(i) } else { 1.0 }).collect();
        let scaled = Mat::from_fn(rows, count, |i, j| self.columns[(i, j)] / scale[i]);
        let qr = scaled.qr();
        let (basis, upper) = (qr.compute_thin_Q(), qr.thin_R());
        let signed = Mat::from_fn(upper.nrows(), count, |i, j| self.signs[j] * upper[(i, j)]);
        let Ok(eigen) = (signed * upper.transpose()).self_adjoint_eigen(Side::Lower) else {
            return self;
        };
        let values: Vec<f64> = eigen.S().column_vector().iter().copied().collect();
        let vectors = basis * eigen.U();
        // Smaller eigenvalues are rounding of the largest.
        let floor = f64::EPSILON * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let kept: Vec<usize> = (0..values.len()).filter(|&j| values[j].abs() > floor).collect();
        Self {
            columns: Mat::from_fn(rows, kept.len(), |i, j| {
                scale[i] * vectors[(i, kept[j])] * values[kept[j]].abs().sqrt()
            }),
            signs: kept.iter().map(|&j| values[j].signum()).collect(),
            slots: self.slots,
        }
    }
}

impl Edit {
    /// # Errors
    /// [`InverseError::Singular`] if the ring's own algebra fails.
    pub(crate) fn split(change: &RingChange, negative: usize) -> Result<Self, InverseError> {
        let a22 = Capacitance::of_signed("a22", change.a22.as_ref(), negative)?;
        let released = a22.half_solve(change.b.as_ref());
        let (lost, gained) = released.split_at_col(released.ncols() - negative);
        let (more, less) = (change.positive.as_ref(), change.negative.as_ref());
        let parts = [(more, 1.0), (gained, 1.0), (lost, -1.0), (less, -1.0)];
        let own = &change.a22;
        Ok(Self::Split {
            old: LowRank::new(&change.slots, &parts).compressed(),
            lower: a22.solve(change.a12.as_ref()),
            own: Mat::from_fn(own.nrows(), own.ncols(), |i, j| {
                0.5 * own[(i, j)] + 0.5 * own[(j, i)]
            }),
        })
    }

    /// # Errors
    /// As [`split`](Self::split).
    pub(crate) fn merge(
        slot: usize,
        change: &RingChange,
        negative: usize,
    ) -> Result<Self, InverseError> {
        let a22 = Capacitance::of_signed("a22", change.a22.as_ref(), negative)?;
        let released = a22.half_solve(change.b.as_ref());
        let border = a22.half_solve(change.a12.as_ref());
        let first = border.ncols() - negative;
        let (comes, goes) = released.split_at_col(first);
        let (more, less) = (change.positive.as_ref(), change.negative.as_ref());
        let old = [(comes, 1.0), (less, 1.0), (goes, -1.0), (more, -1.0)];
        let (goes, comes) = border.split_at_col(first);
        Ok(Self::Merge {
            slot,
            old: LowRank::new(&change.slots, &old).compressed(),
            border: LowRank::new(&change.slots, &[(goes, -1.0), (comes, 1.0)]),
        })
    }

    pub(crate) fn change(change: &StiffnessChange) -> Self {
        let parts = [(change.added.as_ref(), 1.0), (change.removed.as_ref(), -1.0)];
        Self::Change(LowRank::new(&change.slots, &parts).compressed())
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
                match self.block {
                    1 => self.insert::<1>(&old.slots, lower, own),
                    2 => self.insert::<2>(&old.slots, lower, own),
                    3 => self.insert::<3>(&old.slots, lower, own),
                    _ => self.insert::<4>(&old.slots, lower, own),
                }
            }
            Edit::Merge { slot, old, border } => {
                let own = self.position_of[*slot];
                if old.slots.iter().all(|&other| self.position_of[other] < own) {
                    let old = self.after_removal(*slot, old);
                    self.remove(*slot);
                    return self.change(&old, scratch);
                }
                let whole = match self.block {
                    1 => self.released::<1>(*slot, [old, border]),
                    2 => self.released::<2>(*slot, [old, border]),
                    3 => self.released::<3>(*slot, [old, border]),
                    _ => self.released::<4>(*slot, [old, border]),
                };
                let whole = self.after_removal(*slot, &whole).compressed();
                self.remove(*slot);
                self.change(&whole, scratch)
            }
        }
    }

    fn change(&mut self, change: &LowRank, scratch: &mut Scratch) -> Result<(), BadPivot> {
        let positions: Vec<u32> = change.slots.iter().map(|&slot| self.position_of[slot]).collect();
        self.update(&positions, change.columns.as_ref(), &change.signs, scratch)
    }

    /// The same change in the slots as they are once `slot` is gone.
    fn after_removal(&self, slot: usize, change: &LowRank) -> LowRank {
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
        let pivot = Pivot::<M>::new(&square(&panel.diagonal), &floor, self.negative)
            .map_err(|(row, value)| BadPivot { position: low, row, value, limit: floor[row] })?;
        pivot.write(&mut panel.pivots);
        self.push(panel);
        Ok(())
    }

    /// Two changes on the same rows, and what the elimination of a vertex has taken off the others:
    /// l D lᵀ of its own column.
    fn released<const M: usize>(&self, slot: usize, changes: [&LowRank; 2]) -> LowRank {
        let position = self.position_of[slot] as usize;
        let panel = &self.panels[self.panel_of[position] as usize];
        let local = panel.local(position);
        let mut slots = changes[0].slots.clone();
        let mut place = Vec::new();
        let own = (panel.low..position).rev();
        for row in own.chain(panel.rows.iter().map(|&row| row as usize)) {
            let slot = self.slot_of[row];
            let at = slots.iter().position(|&other| other == slot as usize);
            // A row of the panel whose vertex is gone holds zeros.
            place.push(if slot == super::factor::NONE {
                None
            } else {
                Some(at.unwrap_or(slots.len()))
            });
            if at.is_none() && slot != super::factor::NONE {
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
        LowRank { slots, columns, signs }
    }
}
