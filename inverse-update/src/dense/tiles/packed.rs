//! A dense symmetric matrix in packed tiles, lower half: growing is appending, and half of the
//! memory is touched.

use faer::MatRef;

use super::panel::Panel;
use super::tile::{TILE, Tile};
use crate::dense::precision::Precision;

/// Bytes from which on threads share the work: below, waking them costs what they save.
pub(super) const PARALLEL_FROM: usize = 8 << 20;

/// The matrix C, dense and symmetric: tile row after tile row, each from column 0 to the diagonal.
///
/// Tiles are row-major. Those on the diagonal hold both halves, equal to the last bit; rows and
/// columns beyond the last are 0.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tiles<E> {
    /// Behind the last tile row there may be more tiles, all 0, that were in use before.
    pub(super) data: Vec<Tile<E, TILE>>,
    pub(super) rows: usize,
    /// A copy of C_ii: in the tiles they are far apart.
    pub(super) diagonal: Vec<f64>,
}

/// Tiles in front of tile row `i`.
pub(super) fn before(i: usize) -> usize {
    i * (i + 1) / 2
}

/// Tile, row and column of entry (i, j).
fn place(i: usize, j: usize) -> (usize, usize, usize) {
    let (i, j) = if i / TILE < j / TILE { (j, i) } else { (i, j) };
    (before(i / TILE) + j / TILE, i % TILE, j % TILE)
}

impl<E: Precision> Tiles<E> {
    /// Takes the lower triangle of a square matrix, rounded.
    pub(crate) fn from_lower(matrix: MatRef<'_, f64>) -> Self {
        let rows = matrix.nrows();
        let mut tiles = Self::default();
        tiles.grow(rows);
        for i in 0..rows {
            for j in 0..=i {
                tiles.set(i, j, E::of(matrix[(i, j)]));
            }
        }
        tiles.read_diagonal();
        tiles
    }

    pub(super) fn get(&self, i: usize, j: usize) -> E {
        let (tile, row, column) = place(i, j);
        self.data[tile].0[row][column]
    }

    fn set(&mut self, i: usize, j: usize, value: E) {
        let (tile, row, column) = place(i, j);
        self.data[tile].0[row][column] = value;
        if i / TILE == j / TILE {
            self.data[tile].0[column][row] = value;
        }
    }

    /// Whether threads should share a pass.
    pub(super) fn is_large(&self) -> bool {
        self.bytes() >= PARALLEL_FROM && rayon::current_num_threads() > 1
    }

    /// Bytes of the tiles in use.
    pub(super) fn bytes(&self) -> usize {
        before(self.tile_rows()) * size_of::<Tile<E, TILE>>()
    }

    pub(super) fn tile_rows(&self) -> usize {
        self.rows.div_ceil(TILE)
    }

    fn read_diagonal(&mut self) {
        self.diagonal = (0..self.rows).map(|i| self.get(i, i).value()).collect();
    }

    /// Appends rows of 0.
    fn grow(&mut self, more: usize) {
        self.rows += more;
        let need = before(self.tile_rows());
        if need > self.data.capacity() {
            // An eighth more: doubling would hold twice the largest object of the program.
            let spare = (self.data.len() / 8).max(need - self.data.len());
            self.data.reserve_exact(spare);
        }
        if need > self.data.len() {
            self.data.resize(need, Tile::ZERO());
        }
    }

    /// Appends rows: `coupling` is rows() × m, `own` the new m × m corner, lower half read.
    pub(crate) fn append(&mut self, coupling: &Panel, own: MatRef<'_, f64>) {
        let old = self.rows;
        self.grow(own.nrows());
        for a in 0..own.nrows() {
            let (tile_row, row) = ((old + a) / TILE, (old + a) % TILE);
            for (j, source) in coupling.pieces(a).enumerate() {
                // Behind the last row a piece is 0, and so is C there.
                let tile = &mut self.data[before(tile_row) + j].0;
                tile[row].iter_mut().zip(source).for_each(|(entry, &x)| *entry = E::of(x));
                if j == tile_row {
                    (0..row).for_each(|column| tile[column][row] = tile[row][column]);
                }
            }
            for b in 0..=a {
                self.set(old + a, old + b, E::of(own[(a, b)]));
            }
        }
        let new: Vec<f64> = (old..self.rows).map(|i| self.get(i, i).value()).collect();
        self.diagonal.extend(new);
    }

    /// Removes the rows and columns of a slot; the last slot's move into the gap.
    pub(crate) fn swap_remove(&mut self, slot: usize, block: usize) {
        let (first, kept) = (block * slot, self.rows - block);
        if first != kept {
            for j in 0..kept {
                let source = if (first..first + block).contains(&j) { j - first + kept } else { j };
                for a in 0..block {
                    self.set(first + a, j, self.get(kept + a, source));
                }
            }
            self.diagonal.copy_within(kept.., first);
        }
        for i in kept..self.rows {
            let (tile_row, row) = (i / TILE, i % TILE);
            let tiles = &mut self.data[before(tile_row)..=before(tile_row) + tile_row];
            for (j, tile) in tiles.iter_mut().enumerate() {
                tile.0[row].fill(E::default());
                if j == tile_row {
                    tile.0.iter_mut().for_each(|other| other[row] = E::default());
                }
            }
        }
        self.rows = kept;
        self.diagonal.truncate(kept);
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use faer::Mat;

    /// Whole numbers that tell where they stand, exact in f32 too.
    pub(in super::super) fn numbered(n: usize) -> Mat<f64> {
        Mat::from_fn(n, n, |i, j| (1000 * i.max(j) + i.min(j)) as f64 + 1.0)
    }

    pub(in super::super) fn unpack<E: Precision>(c: &Tiles<E>) -> Mat<f64> {
        let whole = Mat::from_fn(c.rows, c.rows, |i, j| c.get(i, j).value());
        for (i, j) in (0..c.rows).flat_map(|i| (0..i).map(move |j| (i, j))) {
            assert_eq!(whole[(i, j)], whole[(j, i)]);
        }
        assert_eq!(c.diagonal, (0..c.rows).map(|i| whole[(i, i)]).collect::<Vec<_>>());
        // Passes rely on zeros behind the last row.
        let filled = whole.col_iter().flat_map(|c| c.iter()).filter(|x| **x != 0.0).count();
        let tiles = (0..c.tile_rows()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let stored: usize = tiles
            .map(|(i, j)| {
                let tile = c.data[before(i) + j].0.as_flattened();
                let count = tile.iter().filter(|x| **x != E::default()).count();
                if i == j { count } else { 2 * count }
            })
            .sum();
        assert_eq!(stored, filled);
        let spare = &c.data[before(c.tile_rows())..];
        assert!(spare.iter().flat_map(|tile| tile.0.as_flattened()).all(|x| *x == E::default()));
        whole
    }

    #[test]
    fn packing_unpacks_in_either_scalar() {
        for n in [0, 1, 47, 48, 49, 100] {
            let whole = numbered(n);
            assert_eq!(unpack(&Tiles::<f64>::from_lower(whole.as_ref())), whole);
            assert_eq!(unpack(&Tiles::<f32>::from_lower(whole.as_ref())), whole);
        }
    }

    #[test]
    fn appended_rows_are_the_bordered_matrix() {
        let whole = numbered(99);
        for (old, m) in [(0, 3), (45, 3), (46, 3), (95, 4), (2, 1), (10, 89)] {
            let mut c = Tiles::<f64>::from_lower(whole.submatrix(0, 0, old, old));
            let coupling = Panel::from_matrix(whole.submatrix(0, old, old, m));
            c.append(&coupling, whole.submatrix(old, old, m, m));
            assert_eq!(unpack(&c), whole.submatrix(0, 0, old + m, old + m));
        }
    }

    #[test]
    fn rows_come_back_into_room_that_was_used() {
        let whole = numbered(50);
        let mut c = Tiles::<f64>::from_lower(whole.as_ref());
        for (old, m) in [(48, 2), (45, 5), (48, 2)] {
            while c.rows > old {
                c.swap_remove(c.rows - 1, 1);
            }
            let coupling = Panel::from_matrix(whole.submatrix(0, old, old, m));
            assert_eq!(unpack(&c), whole.submatrix(0, 0, old, old));
            c.append(&coupling, whole.submatrix(old, old, m, m));
            assert_eq!(unpack(&c), whole);
        }
    }

    #[test]
    fn removal_is_a_permuted_submatrix() {
        for (block, vertices) in [(1, 4), (1, 49), (2, 25), (3, 17), (4, 13)] {
            for slot in [0, 1, vertices / 2, vertices - 2, vertices - 1] {
                let whole = numbered(block * vertices);
                let mut c = Tiles::<f64>::from_lower(whole.as_ref());
                c.swap_remove(slot, block);
                let mut kept: Vec<usize> = (0..vertices).collect();
                kept.swap_remove(slot);
                let row = |i: usize| kept[i / block] * block + i % block;
                let n = block * (vertices - 1);
                let want = Mat::from_fn(n, n, |i, j| whole[(row(i), row(j))]);
                assert_eq!(unpack(&c), want, "slot {slot} of {vertices}, block {block}");
            }
        }
    }
}
