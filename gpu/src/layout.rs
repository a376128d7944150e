//! How C lies on the device: packed tiles of the lower half, in chunks.

/// Rows and columns of a tile.
pub(crate) const TILE: usize = 64;

/// Numbers in a tile.
pub(crate) const TILE_AREA: usize = TILE * TILE;

/// Most rows: the kernels find a tile's place by a square root in f32.
pub(crate) const MOST_ROWS: usize = 2000 * TILE;

/// Tiles in front of tile row `i`.
pub(crate) fn before(i: usize) -> usize {
    i * (i + 1) / 2
}

/// Tile rows of so many rows.
pub(crate) fn tile_rows(rows: usize) -> usize {
    rows.div_ceil(TILE)
}

/// Bytes that an inverse of that many rows takes on a device, for numbers of 4 or 8 bytes.
///
/// The tiles of C without what a chunk leaves over at the end, and the scratch beside them: columns
/// put off and staged, partial sums, and the way back.
#[must_use]
pub fn needed_bytes(rows: usize, number_bytes: u64) -> u64 {
    let tiles = before(tile_rows(rows)) as u64;
    let stride = (tile_rows(rows) * TILE) as u64;
    let columns = (crate::room::FRONT + 2 * crate::room::GATHER + crate::room::BATCH) as u64;
    number_bytes * (tiles * (TILE_AREA + 2 * TILE) as u64 + columns * stride)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_largest_mesh_takes_half_of_a_full_matrix() {
        // 10368 rows are 162 tile rows, 13203 tiles of 16 KiB in f32.
        let tiles = 13_203 * 16_384;
        let need = needed_bytes(10_368, 4);
        assert!(need > tiles && need < tiles + tiles / 8, "{need}");
        assert_eq!(needed_bytes(10_368, 8), 2 * need);
        assert!(need < 10_368 * 10_368 * 4 * 6 / 10);
    }
}
