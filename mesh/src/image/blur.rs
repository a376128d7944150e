//! Gaussian smoothing of intensity images.

use rayon::prelude::*;

use crate::image::ImageError;
use crate::image::volume::IntensityVolume;

/// The kernel ends at this many standard deviations: what is cut off weighs 6·10⁻⁵.
const TRUNCATION: f64 = 4.0;

/// Convolves an image with a Gaussian of standard deviation `sigma_mm`, truncated at 4σ:
/// v′(i) = Σ w(k) v(i + k) / Σ w(k), w(k) = exp(−½ (k·h/σ)²), one axis after the other, over
/// those k for which voxel i + k exists.
///
/// So a constant image stays the same bit by bit, and nothing leaks in over the border; the sum
/// of all voxels is kept if none within 8σ of the border differs from 0. σ = 0 changes nothing.
///
/// Units: σ in mm, h the grid's spacing. Cost: O(voxels · σ/h), in parallel; three copies of
/// the image.
///
/// # Errors
/// [`ImageError::Parameter`] if σ is negative or not finite.
pub fn gaussian_blur(
    image: &IntensityVolume,
    sigma_mm: f64,
) -> Result<IntensityVolume, ImageError> {
    if !(sigma_mm >= 0.0 && sigma_mm.is_finite()) {
        let (field, want) = ("the blur's standard deviation", "finite and >= 0 mm");
        return Err(ImageError::Parameter { field, value: sigma_mm, want });
    }
    let grid = image.grid();
    let sigma = sigma_mm / grid.spacing_mm;
    let mut values = image.values().to_vec();
    for axis in 0..3 {
        let weights = half_kernel(sigma, grid.dims[axis]);
        if weights.len() > 1 {
            values = convolve(&values, grid.dims, axis, &weights);
        }
    }
    IntensityVolume::new(grid.clone(), values)
}

/// w(0), w(1), …, no longer than the axis. Units: σ in voxels.
fn half_kernel(sigma: f64, voxels: usize) -> Vec<f64> {
    let reach = (TRUNCATION * sigma).floor().min(voxels as f64 - 1.0) as usize;
    (0..=reach)
        .map(|k| if k == 0 { 1.0 } else { (-0.5 * (k as f64 / sigma).powi(2)).exp() })
        .collect()
}

fn convolve(from: &[f32], dims: [usize; 3], axis: usize, weights: &[f64]) -> Vec<f32> {
    let [nx, ny, nz] = dims;
    let mut blurred = vec![0.0; from.len()];
    blurred.par_chunks_mut(nx).enumerate().for_each_init(
        || vec![0.0; nx],
        |sums, (row, blurred)| {
            let line = |row: usize| &from[row * nx..][..nx];
            let (y, z) = (row % ny, row / ny);
            match axis {
                0 => along_row(line(row), weights, blurred),
                1 => across_rows(|y| line(y + ny * z), (y, ny), weights, sums, blurred),
                _ => across_rows(|z| line(y + ny * z), (z, nz), weights, sums, blurred),
            }
        },
    );
    blurred
}

/// The indices that the kernel reaches from `at` among `count`, with their weights.
fn reached(at: usize, count: usize, weights: &[f64]) -> impl Iterator<Item = (usize, f64)> + Clone {
    let reach = weights.len() - 1;
    (at.saturating_sub(reach)..=(at + reach).min(count - 1))
        .map(move |other| (other, weights[other.abs_diff(at)]))
}

fn along_row(from: &[f32], weights: &[f64], blurred: &mut [f32]) {
    for (at, blurred) in blurred.iter_mut().enumerate() {
        let here = f64::from(from[at]);
        let (mut sum, mut total) = (0.0, 0.0);
        for (other, weight) in reached(at, from.len(), weights) {
            // Differences from the middle, so that a constant stays exact.
            sum += weight * (f64::from(from[other]) - here);
            total += weight;
        }
        *blurred = (here + sum / total) as f32;
    }
}

/// The same for all voxels of row `at` among `count`, which run across the kernel.
fn across_rows<'a>(
    row: impl Fn(usize) -> &'a [f32],
    (at, count): (usize, usize),
    weights: &[f64],
    sums: &mut [f64],
    blurred: &mut [f32],
) {
    let here = row(at);
    sums.fill(0.0);
    let mut total = 0.0;
    for (other, weight) in reached(at, count, weights) {
        let there = row(other);
        for (sum, (&there, &here)) in sums.iter_mut().zip(there.iter().zip(here)) {
            *sum += weight * (f64::from(there) - f64::from(here));
        }
        total += weight;
    }
    for (blurred, (sum, &here)) in blurred.iter_mut().zip(sums.iter().zip(here)) {
        *blurred = (f64::from(here) + sum / total) as f32;
    }
}
