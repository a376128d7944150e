//! Updates made together: one submatrix of C is read for all of them, and one set of columns
//! staged.

use std::collections::HashMap;

use faer::{Mat, MatRef};

use super::inverse::Delayed;
use super::terms::Terms;
use crate::InverseError;
use crate::change::{NetChange, Update, UpdateRef};
use crate::dense::precision::Precision;
use crate::dense::store::{DenseStore, Staged};
use crate::maintainer::InverseMaintainer;
use crate::matrix::{RowsBefore, SparseStiffness};

/// Most rows of C that one batch reads: each column staged is made of all of them.
const MOST_ROWS: usize = 192;

/// Updates whose small algebra is done, on the rows R that all of them touch.
///
/// With s the rows R and behind them those of the vertices that came in, it keeps C_ss as the
/// updates so far have left it, and X with C_:s = C⁰_:R X, C⁰ being what the store holds. An update
/// by U Λ Uᵀ on rows r ⊂ s reads C_rr, adds Y = C_:r W = C⁰_:R (X_:r W), hence C_ss ← C_ss − Y_s Σ
/// Y_sᵀ and X ← X − (X_:r W) Σ Y_sᵀ; a new vertex adds C_:m = C_:r t, that is X_:m = X_:r t.
struct Batch {
    /// R: rows of C in the store.
    rows: Vec<usize>,
    /// The place in s of a slot's first row.
    place: HashMap<usize, usize>,
    /// C_ss, both halves, with space for all vertices that are added.
    block: Mat<f64>,
    /// X, with the same space.
    x: Mat<f64>,
    /// Rows of s so far.
    known: usize,
    /// X_:r W of every update, column by column, and the signs of these columns.
    terms: Vec<Vec<f64>>,
    signs: Vec<f64>,
}

impl Batch {
    /// `own`: C_RR on the rows of `slots`; `more`: rows of all vertices to come.
    fn new(slots: &[usize], rows: Vec<usize>, own: &Mat<f64>, more: usize) -> Self {
        let known = rows.len();
        let each = known / slots.len().max(1);
        let all = known + more;
        let is_own = |i: usize, j: usize| i < known && j < known;
        Self {
            place: slots.iter().enumerate().map(|(at, &slot)| (slot, each * at)).collect(),
            block: Mat::from_fn(all, all, |i, j| if is_own(i, j) { own[(i, j)] } else { 0.0 }),
            x: Mat::from_fn(known, all, |i, j| if i == j { 1.0 } else { 0.0 }),
            rows,
            known,
            terms: Vec::new(),
            signs: Vec::new(),
        }
    }

    /// Takes an update; a split appends `slot`. False, and nothing taken, if it has to be made by
    /// itself: it leaves C much softer, or its small factor fails.
    fn take<E: Precision>(
        &mut self,
        update: UpdateRef<'_>,
        slot: usize,
        k: &SparseStiffness,
    ) -> bool {
        let (m, negative) = (k.block(), k.negative());
        let at: Vec<usize> =
            update.slots().iter().flat_map(|slot| self.place[slot]..self.place[slot] + m).collect();
        let Ok(net) = NetChange::of(update, negative) else { return false };
        // C ← C − C_:r U (Λ + Uᵀ C_rr U)⁻¹ Uᵀ C_r:.
        let ring = Mat::from_fn(at.len(), at.len(), |i, j| self.block[(at[i], at[j])]);
        match Terms::new::<E>(&net, &ring, negative) {
            Ok(terms) if update.removed().is_none() && !terms.is_softening => {
                self.add(&at, terms.w.as_ref(), &terms.signs);
            }
            _ => return false,
        }
        if net.t.ncols() > 0 {
            self.append(&at, &net.t, &net.inverse);
            self.place.insert(slot, self.known);
            self.known += m;
        }
        true
    }

    /// C ← C + Y Σ Yᵀ with Y = C_:r `w`.
    fn add(&mut self, at: &[usize], w: MatRef<'_, f64>, signs: &[f64]) {
        let known = self.known;
        let of_rows = self.selected(&self.x, at) * w;
        let y = self.selected(&self.block, at) * w;
        for (k, &sign) in signs.iter().enumerate() {
            for j in 0..known {
                let factor = sign * y[(j, k)];
                for i in 0..of_rows.nrows() {
                    self.x[(i, j)] += of_rows[(i, k)] * factor;
                }
                // One half, mirrored: C_ss stays symmetric to the last bit.
                for i in j..known {
                    self.block[(i, j)] += y[(i, k)] * factor;
                    self.block[(j, i)] = self.block[(i, j)];
                }
            }
            self.terms.push(of_rows.col(k).iter().copied().collect());
            self.signs.push(sign);
        }
    }

    /// Appends the rows C_m: = tᵀ C_r: with the corner `inverse` + tᵀ C_rr t.
    fn append(&mut self, at: &[usize], t: &Mat<f64>, inverse: &Mat<f64>) {
        let (known, m) = (self.known, t.ncols());
        let of_rows = self.selected(&self.x, at) * t;
        let border = self.selected(&self.block, at) * t;
        let own = inverse + t.transpose() * Mat::from_fn(at.len(), m, |i, a| border[(at[i], a)]);
        for a in 0..m {
            for i in 0..of_rows.nrows() {
                self.x[(i, known + a)] = of_rows[(i, a)];
            }
            for i in 0..known {
                self.block[(i, known + a)] = border[(i, a)];
                self.block[(known + a, i)] = border[(i, a)];
            }
            for b in 0..m {
                self.block[(known + a, known + b)] = own[(a.max(b), a.min(b))];
            }
        }
    }

    /// Some columns of a matrix, on the rows that are known.
    fn selected(&self, matrix: &Mat<f64>, at: &[usize]) -> Mat<f64> {
        Mat::from_fn(matrix.nrows().min(self.known), at.len(), |i, j| matrix[(i, at[j])])
    }

    /// What the store has to make of C⁰_:R: the terms, and behind them the new rows.
    fn factors(&self) -> Mat<f64> {
        let (read, k) = (self.rows.len(), self.terms.len());
        Mat::from_fn(read, k + self.known - read, |i, j| match self.terms.get(j) {
            Some(term) => term[i],
            None => self.x[(i, read + j - k)],
        })
    }

    /// C on the rows that came in.
    fn corner(&self) -> MatRef<'_, f64> {
        let read = self.rows.len();
        self.block.submatrix(read, read, self.known - read, self.known - read)
    }
}

/// How many updates, from the first on, can share one read of C, and the present slots that they
/// touch: together up to [`MOST_ROWS`] rows, with up to `most` columns of terms.
fn together(updates: &[Update], k: &SparseStiffness, most: usize) -> (usize, Vec<usize>) {
    let (mut old, mut columns, mut vertices) = (Vec::new(), 0, k.vertices());
    for (at, update) in updates.iter().enumerate() {
        let update = update.borrowed();
        let new = |slot: &&usize| **slot < k.vertices() && !old.contains(*slot);
        let mut more: Vec<usize> = update.slots().iter().filter(new).copied().collect();
        more.sort_unstable();
        more.dedup();
        columns += update.most_columns(k.block());
        let is_refused =
            update.removed().is_some() || update.slots().iter().any(|&slot| slot >= vertices);
        let is_full = k.block() * (old.len() + more.len()) > MOST_ROWS || columns > most;
        if is_refused || (at > 0 && is_full) {
            return (at, old);
        }
        old.extend(more);
        vertices += usize::from(matches!(update, UpdateRef::Split(_)));
    }
    (updates.len(), old)
}

impl<S: DenseStore> Delayed<S> {
    /// Makes updates, as many at a time as share one submatrix of C; those before a refused one
    /// stay.
    pub(super) fn update_all(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        let (mut done, most) = (0, self.method().most);
        while done < updates.len() {
            let (group, slots) = together(&updates[done..], &self.stiffness, most);
            let made = match group {
                0 | 1 => 0,
                _ => self.update_together(&updates[done..done + group], &slots),
            };
            done += made;
            if made < group.max(1) {
                let alone = updates[done].make(self);
                alone.map_err(|source| InverseError::in_batch(done, source))?;
                done += 1;
            }
        }
        Ok(())
    }

    /// Makes the first of these updates by one update of C; they touch `slots` and each other's
    /// vertices. Returns how many: the next one, if any, has to be made alone.
    fn update_together(&mut self, updates: &[Update], slots: &[usize]) -> usize {
        let mut before = Vec::with_capacity(updates.len());
        let made = self.try_together(updates, slots, &mut before);
        made.unwrap_or_else(|cause| {
            tracing::debug!(%cause, "{}: updates are made one by one", self.name());
            before.into_iter().rev().for_each(|rows| self.stiffness.restore(rows));
            0
        })
    }

    /// K is changed on the way, to check one update after the other; `before` tells how it was.
    fn try_together(
        &mut self,
        updates: &[Update],
        slots: &[usize],
        before: &mut Vec<RowsBefore>,
    ) -> Result<usize, InverseError> {
        let rows = self.stiffness.rows_of(slots);
        let own = self.read(|method| method.ask(|store| store.submatrix(&rows)))?;
        let mut batch = Batch::new(slots, rows, &own, self.stiffness.block() * updates.len());
        for update in updates.iter().map(Update::borrowed) {
            let slot = self.stiffness.vertices();
            if self.stiffness.check(update).is_err()
                || !batch.take::<S::Scalar>(update, slot, &self.stiffness)
            {
                break;
            }
            before.push(self.stiffness.rows_before(update.slots()));
            self.stiffness.apply_update(update);
        }
        if !before.is_empty() {
            let (x, own) = (batch.factors(), batch.corner().to_owned());
            let (rows, signs) = (&batch.rows, &batch.signs);
            let staged = Staged { rows, x: x.as_ref(), plus: None, signs };
            let (k, block) = (&self.stiffness, self.stiffness.block());
            self.read(|method| {
                method.stage(k, &staged, &own, &(0..0))?;
                method.accept(own.as_ref(), None, block)
            })?;
        }
        Ok(before.len())
    }
}
