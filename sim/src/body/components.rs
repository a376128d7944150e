//! The components of a body, base cells joined by faces: which are held, and which go.

use nalgebra::Vector3;
use yawara_mesh::CellGrid;
use yawara_mesh::volume::LabelVolume;

use super::summary::{DomainSummary, Part};

/// The number of voxels in each base cell that are not void. Cost: O(voxels).
pub(crate) fn solid_voxels(volume: &LabelVolume, grid: &CellGrid) -> Vec<u64> {
    let mut counts = vec![0; grid.cells.iter().product()];
    let [nx, ny, _] = volume.grid().dims;
    for (row, ids) in volume.labels().chunks_exact(nx).enumerate() {
        let (y, z) = (row % ny, row / ny);
        for x in (0..nx).filter(|&x| ids[x] != 0) {
            counts[grid.cell_of([x, y, z].map(|voxel| voxel as i64))] += 1;
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

/// True where the points do not lie on one line: enough to hold a rigid body.
pub(crate) fn spans_a_plane(points: &[Vector3<f64>]) -> bool {
    let Some((first, others)) = points.split_first() else {
        return false;
    };
    let Some(line) = others
        .iter()
        .map(|p| p - first)
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
    else {
        return false;
    };
    // Points closer to the line than a millionth of its length do not keep a body from turning about
    // it; rounding is far smaller.
    others.iter().any(|p| (p - first).cross(&line).norm() > 1e-6 * line.norm_squared())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_one_line_hold_nothing() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.1 * x);
        assert!(!spans_a_plane(&[]));
        assert!(!spans_a_plane(&[at(1.0, 0.0); 4]));
        assert!(!spans_a_plane(&[at(0.1, 0.3), at(0.2, 0.6), at(0.3, 0.9)]));
        assert!(spans_a_plane(&[at(0.1, 0.3), at(0.2, 0.6), at(0.3, 0.91)]));
    }
}
