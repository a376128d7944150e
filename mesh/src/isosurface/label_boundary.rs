//! Where a label begins and ends, asked box by box: what a mesh must resolve to carry its outline.

use super::error::SurfaceError;
use super::label_field::label_box;
use crate::bisection::kuhn::extent;
use crate::bisection::{BisectionForest, Tet};
use crate::image::volume::LabelVolume;

/// How many voxels of one label any box of voxels holds.
///
/// A summed-volume table: 4 bytes per voxel of the label's bounding box.
#[derive(Clone, Debug)]
pub struct LabelBoundary {
    /// Entry (x, y, z): voxels of the label below x, y and z, counted from `first`.
    sums: Vec<u32>,
    first: [i64; 3],
    dims: [usize; 3],
}

impl LabelBoundary {
    /// Counts dense label `label`. Cost: O(voxels).
    ///
    /// # Errors
    /// [`SurfaceError::IsoSurface`] if `label` is 0 or not in the volume's table.
    pub fn new(volume: &LabelVolume, label: u16) -> Result<Self, SurfaceError> {
        let Some([low, high]) = label_box(volume, label)? else {
            return Ok(Self { sums: vec![0], first: [0; 3], dims: [0; 3] });
        };
        let dims: [usize; 3] = std::array::from_fn(|i| high[i] + 1 - low[i]);
        let mut boundary = Self { sums: Vec::new(), first: low.map(|c| c as i64), dims };
        boundary.sums = vec![0; dims.iter().map(|d| d + 1).product()];
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                let mut row = 0;
                for x in 0..dims[0] {
                    let same = volume.get(low[0] + x, low[1] + y, low[2] + z) == label;
                    row += u32::from(same);
                    let [here, left, below, both] = [(1, 1), (0, 1), (1, 0), (0, 0)]
                        .map(|(dy, dz)| boundary.index([x + 1, y + dy, z + dz]));
                    let sums = &mut boundary.sums;
                    sums[here] = row + sums[left] + sums[below] - sums[both];
                }
            }
        }
        Ok(boundary)
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + (self.dims[0] + 1) * (y + (self.dims[1] + 1) * z)
    }

    /// Voxels of the label from `low` to before `high`; outside the volume there are none.
    /// Cost: O(1).
    pub fn count(&self, low: [i64; 3], high: [i64; 3]) -> u64 {
        let clamp = |at: [i64; 3]| -> [usize; 3] {
            std::array::from_fn(|i| (at[i] - self.first[i]).clamp(0, self.dims[i] as i64) as usize)
        };
        let (low, high) = (clamp(low), clamp(high));
        if (0..3).any(|i| low[i] >= high[i]) {
            return 0;
        }
        let corner = |bits: usize| {
            let at = std::array::from_fn(|i| if bits >> i & 1 == 1 { high[i] } else { low[i] });
            i64::from(self.sums[self.index(at)])
        };
        // Each low side taken subtracts once.
        let sign = |bits: usize| if bits.count_ones() % 2 == 1 { 1 } else { -1 };
        (0..8).map(|bits| sign(bits) * corner(bits)).sum::<i64>() as u64
    }

    /// True where the bounding box of `tet`, widened by `margin` voxels, holds voxels of the
    /// label and others (void and what lies outside the volume are others).
    pub fn crosses(&self, forest: &BisectionForest, tet: &Tet, margin: f64) -> bool {
        let grid = forest.tree().grid();
        let scale = grid.voxels_per_cell as f64 / f64::from(forest.domain().lattice().units);
        let corners = tet.vertices.map(|v| forest.point(v));
        let sides = [0, 1, 2].map(|axis| {
            let first = grid.first_voxel[axis] as f64;
            let [low, high] = extent(&corners, axis).map(|c| first + scale * f64::from(c));
            [(low - margin).floor() as i64, (high + margin).ceil() as i64]
        });
        let all: u64 = sides.iter().map(|[low, high]| (high - low) as u64).product();
        let count = self.count(sides.map(|[low, _]| low), sides.map(|[_, high]| high));
        count > 0 && count < all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::volume::Grid;

    #[test]
    fn counts_are_those_of_a_loop_over_the_voxels() {
        let dims = [5, 4, 6];
        let label = |i: usize| (i * i + i / 7) % 3;
        let labels: Vec<u16> = (0..120).map(|i| label(i) as u16).collect();
        let volume = LabelVolume::new(Grid::centred(dims, 1.0), labels, vec![0, 10, 20]).unwrap();
        let boundary = LabelBoundary::new(&volume, 2).unwrap();
        for low in [[-3, 0, 1], [0, 0, 0], [2, 1, 3], [4, 3, 5]] {
            for high in [[1, 1, 2], [9, 9, 9], [3, 4, 6], [5, 4, 6]] {
                let mut want = 0;
                for z in low[2].max(0)..high[2].min(6) {
                    for y in low[1].max(0)..high[1].min(4) {
                        for x in low[0].max(0)..high[0].min(5) {
                            want += u64::from(volume.get(x as usize, y as usize, z as usize) == 2);
                        }
                    }
                }
                assert_eq!(boundary.count(low, high), want, "{low:?} {high:?}");
            }
        }
    }

    #[test]
    fn labels_that_are_not_in_the_table_are_refused() {
        let volume = LabelVolume::new(Grid::centred([1; 3], 1.0), vec![0], vec![0, 5]).unwrap();
        for label in [0, 2] {
            let error = LabelBoundary::new(&volume, label).unwrap_err();
            assert!(matches!(error, SurfaceError::IsoSurface { .. }), "{error}");
        }
        assert_eq!(LabelBoundary::new(&volume, 1).unwrap().count([-9; 3], [9; 3]), 0);
    }
}
