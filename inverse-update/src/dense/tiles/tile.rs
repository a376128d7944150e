//! The unit of storage.

use crate::dense::precision::Precision;

/// Rows and columns of a tile. A tile and two panels of some twenty columns fit the first-level
/// cache, and a whole number of kernels fits a tile.
pub(crate) const TILE: usize = 48;

/// A tile, row-major, or with one row a piece of a panel: aligned to cache lines, so that no vector
/// straddles two.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Tile<E, const ROWS: usize>(pub(super) [[E; TILE]; ROWS]);

impl<E: Precision, const ROWS: usize> Tile<E, ROWS> {
    pub(super) const ZERO: fn() -> Self = || Self([[E::default(); TILE]; ROWS]);
}
