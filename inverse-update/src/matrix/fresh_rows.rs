//! Block rows of K, summed anew from all elements that there are.

use std::sync::Arc;

use faer::MatRef;

use super::checks::{check_range, check_slots};
use super::stiffness::{BlockRow, CANCELLED, SparseStiffness};
use crate::InverseError;

/// Some block rows of K as plain assembly gives them.
///
/// An update adds and takes away what is much stiffer than what is left: each time its rounding
/// stays in K. Rows that are put in the place of such sums, by
/// [`InverseMaintainer::refresh`](crate::InverseMaintainer::refresh), are as right as those of the
/// first K, whatever has happened. [`add`](Self::add) every element that has one of the slots, in
/// any order; units: N/m.
#[derive(Debug, Clone)]
pub struct FreshRows {
    block: usize,
    /// By slot of K the number of its row here.
    place: Vec<Option<usize>>,
    slots: Vec<usize>,
    /// Columns in the order in which they came.
    rows: Vec<BlockRow>,
    /// Of each block of each row the largest of what it was summed from.
    scales: Vec<Vec<f64>>,
    /// Working memory of [`add`](Self::add).
    entries: Vec<f64>,
    halved: Vec<f64>,
}

impl FreshRows {
    /// No elements yet, for rows `slots` of a K of `vertices` blocks of `block` rows.
    /// # Errors
    /// [`InverseError::Slot`] or [`InverseError::DuplicateSlot`].
    pub fn new(vertices: usize, block: usize, slots: Vec<usize>) -> Result<Self, InverseError> {
        check_range(&slots, vertices)?;
        let mut place = vec![None; vertices];
        for (at, &slot) in slots.iter().enumerate() {
            if place[slot].replace(at).is_some() {
                return Err(InverseError::DuplicateSlot(slot));
            }
        }
        let (rows, scales) = (vec![BlockRow::default(); slots.len()], vec![vec![]; slots.len()]);
        Ok(Self { block, place, slots, rows, scales, entries: Vec::new(), halved: Vec::new() })
    }

    /// Whether the row of a slot is among them.
    #[must_use]
    pub fn has(&self, slot: usize) -> bool {
        self.place.get(slot).is_some_and(Option::is_some)
    }

    /// Adds to the rows of `slots`, as far as they are wanted, what an element has there.
    ///
    /// Shapes: `dense` (block · slots)², symmetric but for rounding. Values are checked where K takes the
    /// rows. Cost: O(slots²) blocks.
    /// # Errors
    /// [`InverseError`] on wrong slots or another shape; nothing has been added then.
    pub fn add(&mut self, slots: &[usize], dense: MatRef<'_, f64>) -> Result<(), InverseError> {
        check_slots(slots, self.place.len())?;
        let (m, want) = (self.block, self.block * slots.len());
        if dense.shape() != (want, want) {
            let what = "the matrix to add";
            return Err(InverseError::Shape { what, want: (want, want), got: dense.shape() });
        }
        self.copy(dense);
        for (p, &slot) in slots.iter().enumerate() {
            let Some(at) = self.place[slot] else { continue };
            self.halve(p, want);
            let (row, scales) = (&mut self.rows[at], &mut self.scales[at]);
            for (q, &other) in slots.iter().enumerate() {
                let found = row.columns.iter().position(|&column| column == other);
                let found = found.unwrap_or_else(|| {
                    row.columns.push(other);
                    row.values.resize(row.values.len() + m * m, 0.0);
                    scales.push(0.0);
                    scales.len() - 1
                });
                let sums = &mut row.values[m * m * found..][..m * m];
                let entries = &self.halved[m * m * q..][..m * m];
                let mut largest = scales[found];
                for (sum, entry) in sums.iter_mut().zip(entries) {
                    *sum += entry;
                    // Not `max`, which asks for more than numbers: what is none is found in the sum.
                    largest = if entry.abs() > largest { entry.abs() } else { largest };
                }
                scales[found] = largest;
            }
        }
        Ok(())
    }

    /// The entries of an element, columns one after the other.
    fn copy(&mut self, dense: MatRef<'_, f64>) {
        self.entries.clear();
        for column in dense.col_iter() {
            match column.try_as_col_major() {
                Some(column) => self.entries.extend_from_slice(column.as_slice()),
                None => self.entries.extend(column.iter()),
            }
        }
    }

    /// The blocks in row `p` of the element whose matrix of `rows` rows was [copied](Self::copy), row-major one after
    /// the other: the mean of both sides of the diagonal, the same on either.
    fn halve(&mut self, p: usize, rows: usize) {
        let m = self.block;
        self.halved.clear();
        for q in 0..rows / m {
            for a in m * p..m * (p + 1) {
                let mirrored = &self.entries[rows * a + m * q..][..m];
                let own = self.entries[rows * m * q..].chunks_exact(rows).map(|column| column[a]);
                self.halved.extend(mirrored.iter().zip(own).map(|(x, y)| 0.5 * x + 0.5 * y));
            }
        }
    }

    /// A row with its columns in order, without blocks that have cancelled.
    fn sorted(&self, at: usize) -> BlockRow {
        let (size, row) = (self.block * self.block, &self.rows[at]);
        let block = |number: usize| &row.values[size * number..][..size];
        let is_left = |&number: &usize| {
            let largest = block(number).iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            row.columns[number] == self.slots[at] || largest > CANCELLED * self.scales[at][number]
        };
        let mut order: Vec<usize> = (0..row.columns.len()).filter(is_left).collect();
        order.sort_unstable_by_key(|&number| row.columns[number]);
        let columns = order.iter().map(|&number| row.columns[number]).collect();
        BlockRow {
            columns,
            values: order.iter().flat_map(|&number| block(number)).copied().collect(),
        }
    }
}

impl SparseStiffness {
    /// Takes the place of some rows by others, and that of their columns too.
    ///
    /// Cost: O(blocks of the rows).
    /// # Errors
    /// [`InverseError::Shape`] if they are not of a matrix like this one;
    /// [`InverseError::NotFinite`]. K is then unchanged.
    pub fn refresh(&mut self, fresh: &FreshRows) -> Result<(), InverseError> {
        self.check_fresh(fresh)?;
        self.take_fresh(fresh);
        Ok(())
    }

    pub(crate) fn check_fresh(&self, fresh: &FreshRows) -> Result<(), InverseError> {
        let (m, n) = (self.block(), self.dofs());
        let got = (fresh.block, fresh.block * fresh.place.len());
        if got != (m, n) {
            return Err(InverseError::Shape { what: "fresh rows", want: (m, n), got });
        }
        for (row, slot) in fresh.rows.iter().zip(&fresh.slots) {
            if let Some(at) = row.values.iter().position(|x| !x.is_finite()) {
                let (column, e) = (row.columns[at / (m * m)], at % (m * m));
                let (row_number, col) = (m * slot + e / m, m * column + e % m);
                let value = row.values[at];
                return Err(InverseError::NotFinite {
                    what: "a fresh row",
                    row: row_number,
                    col,
                    value,
                });
            }
        }
        Ok(())
    }

    /// [`refresh`](Self::refresh) on checked rows.
    pub(crate) fn take_fresh(&mut self, fresh: &FreshRows) {
        let m = self.block();
        for (at, &slot) in fresh.slots.iter().enumerate() {
            let row = Arc::new(fresh.sorted(at));
            let is_kept = |column: usize| fresh.place[column].is_none();
            let before = std::mem::replace(&mut self.rows[slot], Arc::clone(&row));
            for &column in &before.columns {
                if is_kept(column) && row.columns.binary_search(&column).is_err() {
                    self.row_mut(column).remove(slot, m * m);
                }
            }
            for (&column, value) in row.columns.iter().zip(row.values.chunks_exact(m * m)) {
                if is_kept(column) {
                    let mirrored: Vec<f64> =
                        (0..m * m).map(|e| value[m * (e % m) + e / m]).collect();
                    self.row_mut(column).set(slot, &mirrored);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::{Mat, mat};

    fn spring(k: f64) -> Mat<f64> {
        mat![[k, -k], [-k, k]]
    }

    #[test]
    fn rows_are_those_of_plain_assembly() {
        let springs = [([0, 1], 1e9), ([1, 2], 1.0), ([2, 3], 3.0), ([3, 0], 5.0)];
        let (mut want, mut k) =
            (SparseStiffness::zeros(4, 1).unwrap(), SparseStiffness::zeros(4, 1).unwrap());
        for (slots, stiffness) in springs {
            want.add(&slots, spring(stiffness).as_ref()).unwrap();
            k.add(&slots, spring(1.1 * stiffness).as_ref()).unwrap();
        }
        // A spring too many, which rows 1 and 2 lose; rows 0 and 3 keep what they have of their own.
        k.add(&[1, 3], spring(7.0).as_ref()).unwrap();
        let mut fresh = FreshRows::new(4, 1, vec![2, 1]).unwrap();
        for (slots, stiffness) in springs {
            fresh.add(&slots, spring(stiffness).as_ref()).unwrap();
        }
        k.refresh(&fresh).unwrap();
        assert_eq!(k.neighbours(3), [0, 2, 3]);
        let (got, want) = (k.to_dense(), want.to_dense());
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
            let is_fresh = [1, 2].contains(&i) || [1, 2].contains(&j);
            assert_eq!(got[(i, j)] == want[(i, j)], is_fresh || want[(i, j)] == 0.0, "{i}, {j}");
            assert_eq!(got[(i, j)], got[(j, i)]);
        }
    }

    #[test]
    fn blocks_that_cancel_are_not_kept_and_what_does_not_fit_is_refused() {
        let mut k = SparseStiffness::zeros(2, 1).unwrap();
        k.add(&[0, 1], spring(2.0).as_ref()).unwrap();
        let before = k.to_dense();
        let mut fresh = FreshRows::new(2, 1, vec![0]).unwrap();
        fresh.add(&[0, 1], spring(3.0).as_ref()).unwrap();
        fresh.add(&[0, 1], mat![[1.0, 3.0], [3.0, 1.0]].as_ref()).unwrap();
        assert!(fresh.add(&[0, 1], mat![[1.0]].as_ref()).is_err());
        assert!(fresh.add(&[0, 2], spring(1.0).as_ref()).is_err());
        assert!(FreshRows::new(2, 1, vec![2]).is_err());
        assert_eq!(FreshRows::new(2, 1, vec![0, 0]).err(), Some(InverseError::DuplicateSlot(0)));
        let other = FreshRows::new(3, 1, vec![0]).unwrap();
        assert!(matches!(k.refresh(&other), Err(InverseError::Shape { .. })));
        let mut nan = fresh.clone();
        nan.add(&[0], mat![[f64::NAN]].as_ref()).unwrap();
        assert!(matches!(k.refresh(&nan), Err(InverseError::NotFinite { row: 0, col: 0, .. })));
        assert_eq!(k.to_dense(), before);
        k.refresh(&fresh).unwrap();
        assert_eq!((k.neighbours(0), k.neighbours(1)), (&[0][..], &[1][..]));
        assert_eq!((k.diagonal(0), k.diagonal(1)), (4.0, 2.0));
    }
}
