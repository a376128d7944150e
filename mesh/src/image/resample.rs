//! Brings stored voxels to RAS+ order and, where they are no cubes, to cubes.
//!
//! The bisection's bounds on the shape of tetrahedra hold for cubes alone.

use std::fmt;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::image::ImageError;
use crate::image::placement::Placement;
use crate::image::volume::Grid;
use crate::image::voxels::MAX_VOXELS;

/// Largest ratio between two spacings that still counts as isotropic.
const MAX_SPACING_RATIO: f64 = 1.01;

/// How far a stored spacing may be from the one asked for and count as equal: headers hold f32.
const SAME_SPACING: f64 = 1e-6;

/// A stored voxel becomes at most this many, so that a forged spacing takes no memory.
const MAX_GROWTH: u64 = 256;

/// How values between voxel centres are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the closest centre: labels are not mixed.
    Nearest,
    /// Linear along each axis between the eight centres around.
    Trilinear,
}

/// What was done to make voxels cubes. Its `Display` is a sentence for a summary.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampling {
    /// Stored voxels along right, anterior, superior.
    pub from_dims: [usize; 3],
    /// Their spacings, mm.
    pub from_mm: [f64; 3],
    /// Voxels made along the same axes.
    pub to_dims: [usize; 3],
    /// Their spacing, mm.
    pub to_mm: f64,
    /// How.
    pub interpolation: Interpolation,
}

impl fmt::Display for Resampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [nx, ny, nz] = self.from_dims;
        let [sx, sy, sz] = self.from_mm;
        let [mx, my, mz] = self.to_dims;
        let how = match self.interpolation {
            Interpolation::Nearest => "nearest neighbour",
            Interpolation::Trilinear => "trilinear",
        };
        write!(
            f,
            "resampled {nx}×{ny}×{nz} voxels of {sx:.4} × {sy:.4} × {sz:.4} mm \
             to {mx}×{my}×{mz} of {:.4} mm ({how})",
            self.to_mm
        )
    }
}

/// Where the values along one RAS+ axis come from: file offsets of two neighbours, and the
/// second one's weight.
struct AxisSamples {
    low: Vec<usize>,
    high: Vec<usize>,
    weight: Vec<f64>,
    /// The closer of the two.
    nearest: Vec<usize>,
}

impl AxisSamples {
    /// Sample t lies at (t + ½)·step − ½ + shift in units of stored voxels, clamped to centres.
    fn new(placement: &Placement, axis: usize, count: usize, step: f64, shift: f64) -> Self {
        let last = placement.dims[axis] - 1;
        let mut samples = Self { low: vec![], high: vec![], weight: vec![], nearest: vec![] };
        for t in 0..count {
            let at = ((t as f64 + 0.5) * step - 0.5 + shift).clamp(0.0, last as f64);
            let low = at.floor() as usize;
            let weight = at - low as f64;
            let ends = [low, (low + 1).min(last)].map(|i| placement.file_offset(axis, i));
            samples.low.push(ends[0]);
            samples.high.push(ends[1]);
            samples.nearest.push(ends[usize::from(weight >= 0.5)]);
            samples.weight.push(weight);
        }
        samples
    }
}

/// A grid of cubes, and for each of its voxels where its value comes from.
pub(crate) struct Sampling {
    pub grid: Grid,
    axes: [AxisSamples; 3],
    in_file_order: bool,
    resampled: Option<([usize; 3], [f64; 3])>,
}

impl Sampling {
    /// The stored grid where its voxels are cubes (of `asked_mm`), else the grid of cubes that
    /// has the same middle and along each axis the closest length.
    pub fn new(from: &Placement, asked_mm: Option<f64>) -> Result<Self, ImageError> {
        let smallest = from.spacing_mm.iter().copied().fold(f64::MAX, f64::min);
        let largest = from.spacing_mm.iter().copied().fold(f64::MIN, f64::max);
        let (to_mm, kept) = match asked_mm {
            Some(asked) if !(asked > 0.0 && asked.is_finite()) => {
                let (field, want) = ("the spacing asked for", "finite and > 0 mm");
                return Err(ImageError::Parameter { field, value: asked, want });
            }
            Some(asked) => {
                (asked, from.spacing_mm.iter().all(|s| (s / asked - 1.0).abs() <= SAME_SPACING))
            }
            // The geometric mean keeps the volume.
            None if largest <= MAX_SPACING_RATIO * smallest => {
                (from.spacing_mm.iter().product::<f64>().cbrt(), true)
            }
            None => (smallest, false),
        };
        let dims = if kept { from.dims } else { cubes(from, to_mm)? };
        let axes = [0, 1, 2].map(|axis| {
            let ratio = if kept { 1.0 } else { to_mm / from.spacing_mm[axis] };
            let shift = 0.5 * (from.dims[axis] as f64 - dims[axis] as f64 * ratio);
            AxisSamples::new(from, axis, dims[axis], ratio, shift)
        });
        let half_mm: Vector3<f64> = if kept {
            Vector3::repeat(0.5 * to_mm)
        } else {
            // From the first centre to the box's middle and back by half of the new box.
            Vector3::from([0, 1, 2].map(|axis| {
                let old = from.spacing_mm[axis] * (from.dims[axis] as f64 - 1.0);
                0.5 * (dims[axis] as f64 * to_mm - old)
            }))
        };
        let origin_mm = from.first_centre - from.rotation * half_mm;
        let grid = Grid { dims, spacing_mm: to_mm, rotation: from.rotation, origin_mm };
        let in_file_order = kept && from.in_file_order();
        let resampled = (!kept).then_some((from.dims, from.spacing_mm));
        Ok(Self { grid, axes, in_file_order, resampled })
    }

    /// File offset of the closest stored voxel, for all voxels of the grid, x fastest.
    pub fn nearest_offsets(&self) -> impl Iterator<Item = usize> + Clone {
        let [x, y, z] = self.axes.each_ref().map(|axis| &axis.nearest);
        z.iter().flat_map(move |k| {
            y.iter().flat_map(move |j| {
                let row = j + k;
                x.iter().map(move |i| i + row)
            })
        })
    }

    /// The values of all voxels of the grid, x fastest, from those of the file.
    pub fn trilinear(&self, stored: Vec<f32>) -> Vec<f32> {
        if self.in_file_order {
            return stored;
        }
        if self.resampled.is_none() {
            return self.nearest_offsets().map(|at| stored[at]).collect();
        }
        let [nx, ny, nz] = self.grid.dims;
        let [x, y, z] = &self.axes;
        let mut values = vec![0.0; nx * ny * nz];
        // a + w (b − a) is exact where a = b: constants stay constant.
        let mix = |a: f64, b: f64, weight: f64| a + weight * (b - a);
        values.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
            let (j, k) = (row % ny, row / ny);
            let corners = [
                y.low[j] + z.low[k],
                y.high[j] + z.low[k],
                y.low[j] + z.high[k],
                y.high[j] + z.high[k],
            ];
            for (i, value) in values.iter_mut().enumerate() {
                let [a, b, c, d] = corners.map(|corner| {
                    let low = f64::from(stored[corner + x.low[i]]);
                    mix(low, f64::from(stored[corner + x.high[i]]), x.weight[i])
                });
                let (front, back) = (mix(a, b, y.weight[j]), mix(c, d, y.weight[j]));
                *value = mix(front, back, z.weight[k]) as f32;
            }
        });
        values
    }

    /// What was done, or `None` if the stored voxels were taken as they are.
    pub fn report(&self, interpolation: Interpolation) -> Option<Resampling> {
        let (from_dims, from_mm) = self.resampled?;
        let (to_dims, to_mm) = (self.grid.dims, self.grid.spacing_mm);
        Some(Resampling { from_dims, from_mm, to_dims, to_mm, interpolation })
    }
}

/// How many cubes come closest to the stored lengths, at least one along each axis.
fn cubes(from: &Placement, to_mm: f64) -> Result<[usize; 3], ImageError> {
    let counts =
        [0, 1, 2].map(|axis| (from.dims[axis] as f64 * from.spacing_mm[axis] / to_mm).round());
    let voxels: f64 = counts.iter().map(|count| count.max(1.0)).product();
    let stored: u64 = from.dims.iter().map(|&d| d as u64).product();
    let limit = MAX_VOXELS.min(stored.saturating_mul(MAX_GROWTH));
    if voxels.is_nan() || voxels > limit as f64 {
        let from_mm = from.spacing_mm;
        return Err(ImageError::ResampledVoxels { from_mm, to_mm, voxels, limit });
    }
    Ok(counts.map(|count| (count as usize).max(1)))
}
