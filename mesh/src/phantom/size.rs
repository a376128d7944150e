//! Sizes and labels of the procedural organs.

use std::ops::RangeInclusive;

use super::shape::HALF_EXTENT;
use crate::image::ImageError;
use crate::image::volume::Grid;

/// Label of the liver tissue of [`liver`](fn@super::liver), and of all of [`block`](fn@super::block).
pub const PARENCHYMA: i64 = 1;
/// Label of the portal vessels of [`liver`](fn@super::liver).
pub const VESSELS: i64 = 2;
/// Label of the gallbladder of [`liver`](fn@super::liver).
pub const GALLBLADDER_LABEL: i64 = 3;
/// Label of the tumour of [`liver`](fn@super::liver).
pub const TUMOUR: i64 = 4;

/// Voxels across the organ: fewer resolve no gallbladder, more exceed memory.
const VOXELS_ACROSS: RangeInclusive<f64> = 16.0..=640.0;

/// Lengths that are accepted, mm: from a tenth of a mouse's liver to no animal's.
const LENGTHS_MM: RangeInclusive<f64> = 1.0..=10_000.0;

/// Size and seed of the procedural liver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiverPhantom {
    /// From the right end of the organ to the left one, mm; 1 to 10 000.
    pub length_mm: f64,
    /// Edge of a voxel, mm; 1/640 to 1/16 of the length.
    pub voxel_mm: f64,
    /// Picks the vessel tree and the place of the tumour; the outline stays.
    pub seed: u64,
}

impl Default for LiverPhantom {
    /// A grown-up's liver, 200 mm long, in voxels of 2 mm.
    fn default() -> Self {
        Self { length_mm: 200.0, voxel_mm: 2.0, seed: 1 }
    }
}

impl LiverPhantom {
    pub(super) fn check(&self) -> Result<(), ImageError> {
        let &Self { length_mm, voxel_mm, .. } = self;
        let wrong = |field, value, want| Err(ImageError::Parameter { field, value, want });
        // Ranges contain no NaN.
        if !LENGTHS_MM.contains(&length_mm) {
            return wrong("phantom: length_mm", length_mm, "1 to 10000 mm");
        }
        if !VOXELS_ACROSS.contains(&(length_mm / voxel_mm)) {
            return wrong("phantom: voxel_mm", voxel_mm, "1/640 to 1/16 of length_mm");
        }
        Ok(())
    }

    /// The grid that holds the organ with a voxel of background around it.
    pub(super) fn grid(&self) -> Grid {
        let dims = HALF_EXTENT.map(|half| {
            let voxels = (half * self.length_mm / self.voxel_mm).ceil() as usize;
            2 * (voxels + 1)
        });
        Grid::centred(dims, self.voxel_mm)
    }
}
