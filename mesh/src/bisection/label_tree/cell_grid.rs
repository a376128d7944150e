//! How the root cubes of a forest lie on the voxels of a volume.

use nalgebra::Vector3;

use crate::bisection::BisectionError;
use crate::bisection::geometry::Placement;
use crate::bisection::lattice::Lattice;
use crate::image::volume::LabelVolume;

/// How root cubes lie on the voxels of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellGrid {
    /// Root cubes along x, y, z.
    pub cells: [usize; 3],
    /// Voxels along a root cube's edge, 2^k.
    pub voxels_per_cell: usize,
    /// Voxel at the corner of the first cube; may be negative (outside is void).
    pub first_voxel: [i64; 3],
}

impl CellGrid {
    /// The smallest grid of cubes of `voxels_per_cell` (a power of two) that covers the
    /// non-void voxels of `volume`, centred on them.
    ///
    /// # Errors
    /// [`BisectionError::NothingInside`] if all voxels are background.
    pub fn around(volume: &LabelVolume, voxels_per_cell: usize) -> Result<Self, BisectionError> {
        let [low, high] = volume.bounding_box().ok_or(BisectionError::NothingInside)?;
        let mut cells = [0; 3];
        let mut first_voxel = [0; 3];
        for axis in 0..3 {
            let extent = high[axis] + 1 - low[axis];
            cells[axis] = extent.div_ceil(voxels_per_cell);
            let slack = (cells[axis] * voxels_per_cell - extent) as i64;
            first_voxel[axis] = low[axis] as i64 - slack / 2;
        }
        Ok(Self { cells, voxels_per_cell, first_voxel })
    }

    /// Where a lattice on these cubes lies, for voxels of edge `voxel_m` (m), the first of them at
    /// the origin.
    pub fn placement(&self, voxel_m: f64, lattice: &Lattice) -> Placement {
        Placement {
            origin: Vector3::from(self.first_voxel.map(|v| v as f64 * voxel_m)),
            unit: self.voxels_per_cell as f64 * voxel_m / f64::from(lattice.units),
        }
    }

    /// The linear number of the root cube of a voxel, of the nearest one if it lies beside the grid.
    pub fn cell_of(&self, voxel: [i64; 3]) -> usize {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let cell =
                (voxel[axis] - self.first_voxel[axis]).max(0) as usize / self.voxels_per_cell;
            cell.min(self.cells[axis] - 1)
        });
        x + self.cells[0] * (y + self.cells[1] * z)
    }

    /// Coordinates of a linear cell number.
    pub(super) fn cell_coordinates(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells;
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// The level at which one TYPE0 cube is one voxel: 3k for cubes of 2^k voxels.
    pub fn embed_level(&self) -> u8 {
        3 * self.voxels_per_cell.trailing_zeros() as u8
    }
}
