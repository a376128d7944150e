//! The layout of C on the device: packed tiles of the lower half, in chunks.

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
