//! A block of one material.

use super::size::PARENCHYMA;
use crate::image::ImageError;
use crate::image::volume::{Grid, LabelVolume};

/// A box of `cells` voxels, all label 1, without background: beams and blocks.
///
/// Units: mm. The grid's middle lies at the origin. Cost: O(voxels).
///
/// # Errors
/// [`ImageError::Parameter`] if there are no cells or more than 2³¹, or if `voxel_mm` is not
/// finite and positive.
pub fn block(cells: [usize; 3], voxel_mm: f64) -> Result<LabelVolume, ImageError> {
    if !(voxel_mm > 0.0 && voxel_mm.is_finite()) {
        let (value, want) = (voxel_mm, "finite and > 0");
        return Err(ImageError::Parameter { field: "phantom: voxel_mm", value, want });
    }
    let grid = Grid::centred(cells, voxel_mm);
    let count = grid.voxel_count().unwrap_or(usize::MAX);
    if count == 0 || count > 1 << 31 {
        let (value, want) = (count as f64, "1 to 2^31 in all");
        return Err(ImageError::Parameter { field: "phantom: number of cells", value, want });
    }
    LabelVolume::new(grid, vec![1; count], vec![0, PARENCHYMA])
}
