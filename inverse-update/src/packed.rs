//! A dense symmetric matrix, lower rows packed: row i holds its i + 1 entries, so that growing
//! is appending and half the memory is touched.

use faer::{Mat, MatRef};

use crate::signed_columns::SignedColumns;

/// Rows of C handled together, so that a number of Y is loaded once for all of them.
pub(crate) const ROWS: usize = 4;

/// Entries handled together, whatever the vector unit: so sums don't depend on it.
pub(crate) const LANES: usize = 8;

/// The matrix C, dense and symmetric.
#[derive(Debug, Clone, Default)]
pub(crate) struct PackedSymmetric {
    data: Vec<f64>,
    rows: usize,
}

fn offset(row: usize) -> usize {
    row * (row + 1) / 2
}

impl PackedSymmetric {
    /// Takes the lower triangle of a square matrix.
    pub(crate) fn from_lower(matrix: MatRef<'_, f64>) -> Self {
        let rows = matrix.nrows();
        let mut data = Vec::with_capacity(offset(rows));
        for i in 0..rows {
            data.extend((0..=i).map(|j| matrix[(i, j)]));
        }
        Self { data, rows }
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn diagonal(&self, i: usize) -> f64 {
        self.data[offset(i) + i]
    }

    /// The columns that belong to `slots` of `block` rows, rows() × (block·slots).
    pub(crate) fn gather(&self, slots: &[usize], block: usize) -> Mat<f64> {
        let mut columns = Mat::zeros(self.rows, block * slots.len());
        for (p, &slot) in slots.iter().enumerate() {
            for a in 0..block {
                let row = block * slot + a;
                let stored = &self.data[offset(row)..offset(row + 1)];
                let target = columns.col_as_slice_mut(block * p + a);
                target[..=row].copy_from_slice(stored);
                let mut at = offset(row + 1) + row;
                for (i, entry) in target.iter_mut().enumerate().skip(row + 1) {
                    *entry = self.data[at];
                    at += i + 1;
                }
            }
        }
        columns
    }

    /// C ← C + Σ_k s_k y_k y_kᵀ in one pass: C is read and written once. Cost: O(n²k).
    pub(crate) fn add(&mut self, terms: &SignedColumns) {
        pulp::Arch::new().dispatch(Pass { matrix: self, terms });
    }

    #[inline(always)]
    fn add_here(&mut self, terms: &SignedColumns) {
        let mut rest = self.data.as_mut_slice();
        let mut i = 0;
        while i + ROWS <= self.rows {
            let rows: [&mut [f64]; ROWS] = std::array::from_fn(|r| take_mut(&mut rest, i + r + 1));
            terms.add_to_rows(rows, i);
            i += ROWS;
        }
        for i in i..self.rows {
            terms.add_to_rows([take_mut(&mut rest, i + 1)], i);
        }
    }

    /// Appends rows: `coupling` is rows() × m, `own` the new lower m × m corner.
    pub(crate) fn append(&mut self, coupling: MatRef<'_, f64>, own: MatRef<'_, f64>) {
        let more = own.nrows();
        let need = offset(self.rows + more) - self.data.len();
        if self.data.capacity() - self.data.len() < need {
            // An eighth more: doubling would hold twice the largest object of the program.
            self.data.reserve_exact(need.max(self.data.len() / 8));
        }
        for a in 0..more {
            self.data.extend((0..self.rows).map(|j| coupling[(j, a)]));
            self.data.extend((0..=a).map(|b| own[(a, b)]));
        }
        self.rows += more;
    }

    /// Removes the rows and columns of a slot; the last slot's move into the gap.
    pub(crate) fn swap_remove(&mut self, slot: usize, block: usize) {
        let first = block * slot;
        let kept = self.rows - block;
        for a in 0..block {
            let from = offset(kept + a);
            let (to, source) = (first + a, from..from + kept + a + 1);
            if first == kept {
                break;
            }
            self.data.copy_within(source.start..source.start + first, offset(to));
            for b in 0..=a {
                self.data[offset(to) + first + b] = self.data[from + kept + b];
            }
            for j in first + block..kept {
                self.data[offset(j) + to] = self.data[from + j];
            }
        }
        self.data.truncate(offset(kept));
        self.rows = kept;
    }

    /// u = C f, summed in a fixed order: every stored entry is read once.
    pub(crate) fn multiply(&self, f: &[f64], u: &mut [f64]) {
        pulp::Arch::new().dispatch(Product { matrix: self, f, u });
    }

    /// C F, column by column.
    pub(crate) fn multiply_columns(&self, f: &Mat<f64>) -> Mat<f64> {
        let mut u = Mat::zeros(self.rows, f.ncols());
        for j in 0..f.ncols() {
            self.multiply(f.col_as_slice(j), u.col_as_slice_mut(j));
        }
        u
    }

    #[inline(always)]
    fn multiply_here(&self, f: &[f64], u: &mut [f64]) {
        u.fill(0.0);
        let mut rest = self.data.as_slice();
        let mut i = 0;
        while i + ROWS <= self.rows {
            let rows = std::array::from_fn(|r| take(&mut rest, i + r + 1));
            multiply_rows::<ROWS>(rows, i, f, u);
            i += ROWS;
        }
        for i in i..self.rows {
            multiply_rows([take(&mut rest, i + 1)], i, f, u);
        }
    }
}

/// What R consecutive rows, the first of them row i, and their mirror image add to u.
#[inline(always)]
fn multiply_rows<const R: usize>(rows: [&[f64]; R], i: usize, f: &[f64], u: &mut [f64]) {
    let factors: [f64; R] = std::array::from_fn(|r| f[i + r]);
    let chunked = rows.map(|row| row[..i].as_chunks::<LANES>().0);
    let sources = f[..i].as_chunks::<LANES>().0;
    let targets = u[..i].as_chunks_mut::<LANES>().0;
    // One partial sum per lane: a single one would forbid vector instructions.
    let mut sums = [[0.0; LANES]; R];
    for at in 0..i / LANES {
        let mut target = targets[at];
        for r in 0..R {
            let entries = chunked[r][at];
            for lane in 0..LANES {
                sums[r][lane] += entries[lane] * sources[at][lane];
                target[lane] += factors[r] * entries[lane];
            }
        }
        targets[at] = target;
    }
    for r in 0..R {
        let mut sum: f64 = sums[r].iter().sum();
        for j in i - i % LANES..i + r {
            sum += rows[r][j] * f[j];
            u[j] += factors[r] * rows[r][j];
        }
        u[i + r] += sum + rows[r][i + r] * factors[r];
    }
}

/// Takes the first `count` entries off a slice.
fn take<'a>(rest: &mut &'a [f64], count: usize) -> &'a [f64] {
    let (head, tail) = rest.split_at(count);
    *rest = tail;
    head
}

/// [`PackedSymmetric::add`], compiled for each vector unit and chosen at run time.
///
/// Not for the width alone: faer's kernels may return with the upper halves of the vector
/// registers in use, and code for plain SSE2 then runs at a third of its speed.
struct Pass<'a> {
    matrix: &'a mut PackedSymmetric,
    terms: &'a SignedColumns,
}

impl pulp::WithSimd for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.matrix.add_here(self.terms);
    }
}

/// [`PackedSymmetric::multiply`], likewise.
struct Product<'a> {
    matrix: &'a PackedSymmetric,
    f: &'a [f64],
    u: &'a mut [f64],
}

impl pulp::WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.matrix.multiply_here(self.f, self.u);
    }
}

/// As [`take`], to be written to.
fn take_mut<'a>(rest: &mut &'a mut [f64], count: usize) -> &'a mut [f64] {
    let (head, tail) = std::mem::take(rest).split_at_mut(count);
    *rest = tail;
    head
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signed_columns::STRETCH;
    use faer::mat;

    fn five() -> Mat<f64> {
        Mat::from_fn(5, 5, |i, j| (10 * i.max(j) + i.min(j)) as f64 + 1.0)
    }

    fn unpack(c: &PackedSymmetric) -> Mat<f64> {
        c.gather(&(0..c.rows()).collect::<Vec<_>>(), 1)
    }

    #[test]
    fn packing_gathers_back() {
        let c = PackedSymmetric::from_lower(five().as_ref());
        assert_eq!(unpack(&c), five());
        let pair = c.gather(&[1], 2);
        assert_eq!(pair, Mat::from_fn(5, 2, |i, j| five()[(i, j + 2)]));
        assert_eq!(c.diagonal(3), 34.0);
    }

    #[test]
    fn appended_rows_are_the_bordered_matrix() {
        let whole = five();
        let mut c = PackedSymmetric::from_lower(whole.submatrix(0, 0, 3, 3));
        c.append(whole.submatrix(0, 3, 3, 2), whole.submatrix(3, 3, 2, 2));
        assert_eq!(unpack(&c), whole);
    }

    #[test]
    fn removal_is_a_permuted_submatrix() {
        for (slot, kept) in [(0, vec![3, 1, 2]), (1, vec![0, 3, 2]), (2, vec![0, 1, 3])] {
            for block in [1, 2] {
                let n = 4 * block;
                let whole = Mat::from_fn(n, n, |i, j| (100 * i.max(j) + i.min(j)) as f64);
                let mut c = PackedSymmetric::from_lower(whole.as_ref());
                c.swap_remove(slot, block);
                let row = |i: usize| kept[i / block] * block + i % block;
                let want = Mat::from_fn(3 * block, 3 * block, |i, j| whole[(row(i), row(j))]);
                assert_eq!(unpack(&c), want, "slot {slot}, block {block}");
            }
        }
        let mut last = PackedSymmetric::from_lower(five().as_ref());
        last.swap_remove(4, 1);
        assert_eq!(unpack(&last), five().submatrix(0, 0, 4, 4));
    }

    #[test]
    fn one_pass_adds_every_term_once() {
        // Longer than a stretch, whole numbers: exact.
        let n = STRETCH + 7;
        let y = Mat::from_fn(n, 4, |i, k| ((i * (k + 3)) % 5) as f64);
        let w = Mat::from_fn(n, 1, |i, _| (i % 3) as f64);
        let mut c = PackedSymmetric::from_lower(Mat::zeros(n, n).as_ref());
        let terms = SignedColumns::new(y.as_ref(), w.as_ref());
        c.add(&terms);
        let want = &w * w.transpose() - &y * y.transpose();
        assert_eq!(unpack(&c), want);
        assert_eq!(terms.diagonal(n - 1), want[(n - 1, n - 1)]);
    }

    #[test]
    fn multiply_is_the_dense_product() {
        let n = 21;
        let whole = Mat::from_fn(n, n, |i, j| ((i + j) * (i + 1) * (j + 1) % 7) as f64);
        let c = PackedSymmetric::from_lower(whole.as_ref());
        let f: Vec<f64> = (0..n).map(|i| (i % 4) as f64 - 1.0).collect();
        let mut u = vec![f64::NAN; n];
        c.multiply(&f, &mut u);
        for i in 0..n {
            assert_eq!(u[i], (0..n).map(|j| whole[(i, j)] * f[j]).sum::<f64>());
        }
        assert_eq!(mat![[1.0]], unpack(&PackedSymmetric::from_lower(mat![[1.0]].as_ref())));
    }
}
