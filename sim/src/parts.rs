//! The parts of a body that hang together by faces of base cells: which are held, which go.

use yawara_mesh::CellGrid;
use yawara_mesh::volume::LabelVolume;

use crate::body_report::{DomainSummary, Part};

/// The number of voxels in each base cell that are not void. Cost: O(voxels).
pub(crate) fn solid_voxels(volume: &LabelVolume, grid: &CellGrid) -> Vec<u64> {
    let [cells_x, cells_y, _] = grid.cells;
    let mut counts = vec![0; grid.cells.iter().product()];
    let [nx, ny, _] = volume.grid().dims;
    let along = |axis: usize, voxel: usize| {
        // The grid of cells covers all voxels that are not void.
        (voxel as i64 - grid.first_voxel[axis]) as usize / grid.voxels_per_cell
    };
    for (row, ids) in volume.labels().chunks_exact(nx).enumerate() {
        let (y, z) = (row % ny, row / ny);
        for x in (0..nx).filter(|&x| ids[x] != 0) {
            counts[along(0, x) + cells_x * (along(1, y) + cells_y * along(2, z))] += 1;
        }
    }
    counts
}

/// Groups of cells with the number of their voxels and whether each is kept.
pub(crate) fn summary(
    components: &[Vec<usize>],
    kept: impl Fn(&[usize]) -> bool,
    voxels_of_cell: &[u64],
) -> DomainSummary {
    let parts: Vec<Part> = components
        .iter()
        .map(|cells| Part {
            cells: cells.len(),
            voxels: cells.iter().map(|&cell| voxels_of_cell[cell]).sum(),
            kept: kept(cells),
        })
        .collect();
    let kept = parts.iter().filter(|part| part.kept).count();
    DomainSummary { components: parts.len(), kept, parts }
}
