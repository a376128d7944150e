//! How the pixels of a file are stored, and what decoding one frame gives.

use crate::image::voxels::VoxelType;

/// How a pixel is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Format {
    pub columns: u16,
    pub rows: u16,
    /// 8, 16 or 32.
    pub allocated: u32,
    /// Bits of the number, 1 to `allocated`.
    pub stored: u32,
    /// Bits below the number.
    pub shift: u32,
    pub signed: bool,
}

impl Format {
    /// Pixels of a frame.
    pub fn pixels(&self) -> usize {
        usize::from(self.columns) * usize::from(self.rows)
    }

    /// Bytes of a frame as [`Self::allocated`] says.
    pub fn frame_bytes(&self) -> usize {
        self.pixels() * (self.allocated / 8) as usize
    }

    pub fn voxel_type(&self) -> VoxelType {
        match (self.allocated, self.signed) {
            (8, false) => VoxelType::U8,
            (8, true) => VoxelType::I8,
            (16, false) => VoxelType::U16,
            (16, true) => VoxelType::I16,
            (_, false) => VoxelType::U32,
            (_, true) => VoxelType::I32,
        }
    }
}

/// The pixels of one frame, row by row.
pub(super) struct Cells {
    pub cells: Vec<u32>,
    /// Bits of the number in a cell.
    pub bits: u32,
    /// Bits below it.
    pub shift: u32,
}

/// What a decoder refuses: what it found and what would do.
pub(super) struct Refusal {
    pub found: String,
    pub want: String,
}

impl Refusal {
    pub fn new(found: impl ToString, want: impl ToString) -> Self {
        Self { found: found.to_string(), want: want.to_string() }
    }
}
