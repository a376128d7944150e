//! A smooth field whose level ½ is the boundary of a label: its blurred indicator.

use std::f64::consts::LN_2;

use rayon::prelude::*;

use super::error::SurfaceError;
use crate::bisection::{BisectionForest, Point};
use crate::image::volume::LabelVolume;

/// The widest blur, voxels: beyond it an organ's outline has nothing to do with its voxels.
const MAX_SIGMA: f64 = 16.0;

/// The indicator of one label (1 in its voxels, 0 elsewhere and outside the volume), blurred by
/// a Gaussian; linear between voxel centres.
///
/// Raw labels have a boundary of stairs; σ of about one voxel rounds them off. The level ½
/// shrinks a ball of r voxels by about σ²/r of a voxel and a tube by half of that; a tube of
/// r < 1.18 σ, where 1 − exp(−r² / 2σ²) < ½, vanishes: thin vessels want a smaller σ.
/// Memory: one f32 per voxel of the label's bounding box, widened by the blur.
#[derive(Clone, Debug)]
pub struct LabelField {
    values: Vec<f32>,
    /// Voxel of the first value.
    first: [i64; 3],
    dims: [usize; 3],
}

impl LabelField {
    /// The field of dense label `label`: the indicator, convolved along each axis with
    /// w(k) ∝ exp(−k² / 2σ²), Σ w = 1, cut off below 1/2¹² of its peak.
    ///
    /// σ in voxels; 0 leaves the indicator as it is. All 0 for a label without voxels. The same
    /// for any number of threads. Cost: O(voxels of the box · (1 + σ)), twice its memory.
    ///
    /// # Errors
    /// [`SurfaceError::IsoSurface`] if σ is not in 0 to 16 or `label` is 0 or not in the volume's
    /// table.
    pub fn blurred(
        volume: &LabelVolume,
        label: u16,
        sigma_voxels: f64,
    ) -> Result<Self, SurfaceError> {
        // A range contains no NaN.
        if !(0.0..=MAX_SIGMA).contains(&sigma_voxels) {
            let (value, want) = (sigma_voxels, "0 to 16 voxels");
            return Err(SurfaceError::IsoSurface { field: "sigma", value, want });
        }
        let bounds = label_box(volume, label)?;
        let kernel = kernel(sigma_voxels);
        let mut field = Self::indicator(volume, label, bounds, kernel.len() / 2);
        for axis in 0..3 {
            field.values = blur_axis(&field.values, field.dims, axis, &kernel);
        }
        Ok(field)
    }

    /// The 0/1 indicator on the label's box with `margin` voxels around it.
    fn indicator(
        volume: &LabelVolume,
        label: u16,
        bounds: Option<[[usize; 3]; 2]>,
        margin: usize,
    ) -> Self {
        let Some([low, high]) = bounds else {
            return Self { values: Vec::new(), first: [0; 3], dims: [0; 3] };
        };
        let dims: [usize; 3] = std::array::from_fn(|i| high[i] + 1 - low[i] + 2 * margin);
        let mut values = vec![0.0; dims.iter().product()];
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let row = dims[0] * (y - low[1] + margin + dims[1] * (z - low[2] + margin));
                for x in low[0]..=high[0] {
                    if volume.get(x, y, z) == label {
                        values[row + x - low[0] + margin] = 1.0;
                    }
                }
            }
        }
        Self { values, first: low.map(|c| c as i64 - margin as i64), dims }
    }

    /// The value at continuous voxel coordinates (voxel i spans i to i + 1, its centre is
    /// i + ½): trilinear between centres, 0 far from the label. Cost: O(1).
    pub fn at(&self, voxel: [f64; 3]) -> f64 {
        let mut low = [0i64; 3];
        let mut weights = [[0.0; 2]; 3];
        for axis in 0..3 {
            let local = voxel[axis] - 0.5 - self.first[axis] as f64;
            // Also the way out for what is no number or too large for an index.
            if !(local > -1.0 && local < self.dims[axis] as f64) {
                return 0.0;
            }
            low[axis] = local.floor() as i64;
            let fraction = local - local.floor();
            weights[axis] = [1.0 - fraction, fraction];
        }
        let mut sum = 0.0;
        for corner in 0..8usize {
            let side = [corner & 1, corner >> 1 & 1, corner >> 2];
            let at: [i64; 3] = std::array::from_fn(|i| low[i] + side[i] as i64);
            let weight = weights[0][side[0]] * weights[1][side[1]] * weights[2][side[2]];
            sum += weight * self.value(at);
        }
        sum
    }

    fn value(&self, local: [i64; 3]) -> f64 {
        let inside = (0..3).all(|i| local[i] >= 0 && local[i] < self.dims[i] as i64);
        if !inside {
            return 0.0;
        }
        let [x, y, z] = local.map(|c| c as usize);
        self.values[x + self.dims[0] * (y + self.dims[1] * z)].into()
    }

    /// The value at each vertex of a forest, by vertex number; 0 for numbers not in use.
    ///
    /// The forest's label tree says how its cubes lie on the voxels. Cost: O(vertices).
    pub fn on_vertices(&self, forest: &BisectionForest) -> Vec<f64> {
        let grid = forest.tree().grid();
        let voxels_per_unit =
            grid.voxels_per_cell as f64 / f64::from(forest.domain().lattice().units);
        let voxel = |p: Point| -> [f64; 3] {
            std::array::from_fn(|i| grid.first_voxel[i] as f64 + voxels_per_unit * f64::from(p[i]))
        };
        let mut field = vec![0.0; forest.vertex_capacity()];
        for v in forest.vertices() {
            field[v.index()] = self.at(voxel(forest.point(v)));
        }
        field
    }
}

/// First and last voxel of the box around a label, `None` where it has no voxels.
///
/// # Errors
/// [`SurfaceError::IsoSurface`] if `label` is 0 or not in the volume's table.
pub(super) fn label_box(
    volume: &LabelVolume,
    label: u16,
) -> Result<Option<[[usize; 3]; 2]>, SurfaceError> {
    if label == 0 || usize::from(label) >= volume.values().len() {
        let (value, want) = (label.into(), "an id of the volume's label table other than 0");
        return Err(SurfaceError::IsoSurface { field: "dense label", value, want });
    }
    Ok(volume.box_where(|id| id == label))
}

/// Weights w(−r) … w(r); the next one would be below 1/2¹² of w(0).
fn kernel(sigma: f64) -> Vec<f64> {
    let radius = (sigma * (24.0 * LN_2).sqrt()).floor() as i64;
    let weight = |k: i64| if k == 0 { 1.0 } else { (-0.5 * (k as f64 / sigma).powi(2)).exp() };
    let sum: f64 = (-radius..=radius).map(weight).sum();
    (-radius..=radius).map(|k| weight(k) / sum).collect()
}

/// out(i) = Σ w(k) · values(i + k along `axis`), 0 beyond the ends; parallel over rows of x.
fn blur_axis(values: &[f32], dims: [usize; 3], axis: usize, kernel: &[f64]) -> Vec<f32> {
    let [nx, ny, nz] = dims;
    let radius = kernel.len() / 2;
    let mut out = vec![0.0; values.len()];
    if values.is_empty() {
        return out;
    }
    out.par_chunks_mut(nx).enumerate().for_each(|(row, out)| {
        let (y, z) = (row % ny, row / ny);
        let mut sums = vec![0.0f64; nx];
        for (k, weight) in kernel.iter().enumerate() {
            // The source index less the radius, kept unsigned.
            let source_row = match axis {
                0 => Some(row),
                1 => (y + k).checked_sub(radius).filter(|&y| y < ny).map(|y| y + ny * z),
                _ => (z + k).checked_sub(radius).filter(|&z| z < nz).map(|z| y + ny * z),
            };
            let Some(source_row) = source_row else { continue };
            let source = &values[source_row * nx..(source_row + 1) * nx];
            let shift = if axis == 0 { k as i64 - radius as i64 } else { 0 };
            let low = (-shift).max(0) as usize;
            let high = (nx as i64 - shift.max(0)).max(0) as usize;
            for x in low..high {
                sums[x] += weight * f64::from(source[(x as i64 + shift) as usize]);
            }
        }
        for (to, sum) in out.iter_mut().zip(sums) {
            *to = sum as f32;
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::volume::Grid;
    use crate::phantom::block;

    fn one_voxel() -> LabelVolume {
        let grid = Grid::centred([9, 9, 9], 1.0);
        let mut labels = vec![0; 729];
        labels[grid.index(4, 4, 4).unwrap()] = 1;
        LabelVolume::new(grid, labels, vec![0, 1]).unwrap()
    }

    #[test]
    fn a_voxel_becomes_a_gaussian() {
        let field = LabelField::blurred(&one_voxel(), 1, 1.0).unwrap();
        let at = |x: f64, y: f64, z: f64| field.at([4.5 + x, 4.5 + y, 4.5 + z]);
        // Ratios do not depend on the normalisation; f32 values of 1e-3 have 1e-7 relative.
        for (x, y, z) in [(1., 0., 0.), (0., 2., 0.), (0., 0., -1.), (1., -2., 1.), (-2., 1., 0.)] {
            let expected = (-0.5f64 * (x * x + y * y + z * z)).exp();
            assert!((at(x, y, z) / at(0., 0., 0.) / expected - 1.0).abs() < 5e-7, "{x} {y} {z}");
        }
        assert!((at(0.25, 0., 0.) - (0.75 * at(0., 0., 0.) + 0.25 * at(1., 0., 0.))).abs() < 1e-8);
        assert_eq!(at(6.0, 0., 0.), 0.0);
        let mut sum = 0.0;
        for i in 0..13i32.pow(3) {
            sum += at((i % 13 - 6).into(), (i / 13 % 13 - 6).into(), (i / 169 - 6).into());
        }
        assert!((sum - 1.0).abs() < 1e-6, "the blur keeps the volume: {sum}");
    }

    #[test]
    fn outside_of_the_volume_is_void() {
        // The block fills its volume: half of the kernel falls outside at its faces.
        let field = LabelField::blurred(&block([8, 8, 8], 1.0).unwrap(), 1, 1.0).unwrap();
        assert!((field.at([4.0, 0.0, 4.0]) - 0.5).abs() < 1e-3);
        assert!((field.at([8.0, 4.0, 4.0]) - 0.5).abs() < 1e-3);
        assert!(field.at([4.0, 4.0, 4.0]) > 0.999);
        assert_eq!(field.at([f64::NAN, 4.0, 4.0]), 0.0);
        assert_eq!(field.at([1e300, 4.0, 4.0]), 0.0);
    }

    #[test]
    fn no_blur_is_the_indicator() {
        let field = LabelField::blurred(&one_voxel(), 1, 0.0).unwrap();
        assert_eq!(field.at([4.5, 4.5, 4.5]), 1.0);
        assert_eq!(field.at([4.5, 5.0, 4.5]), 0.5);
        assert_eq!(field.at([4.5, 5.5, 4.5]), 0.0);
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for sigma in [-1.0, 16.5, f64::NAN, f64::INFINITY] {
            let error = LabelField::blurred(&one_voxel(), 1, sigma).unwrap_err();
            assert!(matches!(error, SurfaceError::IsoSurface { field: "sigma", .. }), "{error}");
        }
        for label in [0, 2, u16::MAX] {
            let error = LabelField::blurred(&one_voxel(), label, 1.0).unwrap_err();
            assert!(
                matches!(error, SurfaceError::IsoSurface { field: "dense label", .. }),
                "{error}"
            );
        }
    }

    #[test]
    fn a_label_without_voxels_is_nowhere() {
        let volume = LabelVolume::new(Grid::centred([1, 1, 1], 1.0), vec![0], vec![0, 5]).unwrap();
        assert_eq!(LabelField::blurred(&volume, 1, 1.0).unwrap().at([0.5; 3]), 0.0);
    }
}
