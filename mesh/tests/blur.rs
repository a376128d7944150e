//! The Gaussian blur against its definition.

use proptest::prelude::*;
use yawara_mesh::ImageError;
use yawara_mesh::image::gaussian_blur;
use yawara_mesh::volume::{Grid, IntensityVolume};

fn image(dims: [usize; 3], spacing_mm: f64, values: Vec<f32>) -> IntensityVolume {
    IntensityVolume::new(Grid::centred(dims, spacing_mm), values).unwrap()
}

/// A single 1 in the middle of n³ voxels.
fn delta(n: usize, spacing_mm: f64) -> IntensityVolume {
    let mut values = vec![0.0; n * n * n];
    values[n * n * n / 2] = 1.0;
    image([n; 3], spacing_mm, values)
}

#[test]
fn a_point_spreads_symmetrically_and_sums_to_one() {
    let (n, spacing, sigma) = (69, 0.5, 2.0);
    let blurred = gaussian_blur(&delta(n, spacing), sigma).unwrap();
    let sum: f64 = blurred.values().iter().map(|&v| f64::from(v)).sum();
    // Rounded to f32 after each of three passes.
    assert!((sum - 1.0).abs() < 3.0 * 6e-8, "{sum}");
    let (mut second, middle) = ([0.0; 3], (n / 2) as f64);
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                let value = blurred.get(x, y, z).unwrap();
                for mirrored in [(n - 1 - x, y, z), (x, n - 1 - y, z), (x, y, n - 1 - z)] {
                    let other = blurred.get(mirrored.0, mirrored.1, mirrored.2).unwrap();
                    assert_eq!(value, other);
                }
                for turned in [(y, x, z), (z, y, x)] {
                    let other = blurred.get(turned.0, turned.1, turned.2).unwrap();
                    // Three factors in another order, each rounded to f32.
                    assert!((value - other).abs() <= 6.0 * f32::EPSILON * value);
                }
                for (axis, i) in [x, y, z].into_iter().enumerate() {
                    second[axis] += f64::from(value) * ((i as f64 - middle) * spacing).powi(2);
                }
            }
        }
    }
    for moment in second {
        // Cut off at 4σ: 1 − 8 φ(4) = 0.9989 of the variance, and a little for the steps.
        assert!((moment / (sigma * sigma) - 0.9989).abs() < 2e-3, "{moment}");
    }
    // What is farther than 4σ is not reached.
    assert_eq!(blurred.get(17, 34, 34), Some(0.0));
    assert!(blurred.get(18, 34, 34) > Some(0.0));
}

#[test]
fn no_blur_changes_nothing_and_a_wide_one_averages() {
    let values: Vec<f32> = (0..24).map(|v| v as f32).collect();
    let ramp = image([2, 3, 4], 1.0, values);
    for sigma in [0.0, 1e-300, 0.2] {
        assert_eq!(gaussian_blur(&ramp, sigma).unwrap(), ramp, "{sigma}");
    }
    let flat = gaussian_blur(&ramp, 1e6).unwrap();
    assert!(flat.values().iter().all(|v| (v - 11.5).abs() < 1e-5), "{flat:?}");
}

#[test]
fn impossible_widths_are_refused() {
    let image = delta(3, 1.0);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let error = gaussian_blur(&image, bad).unwrap_err();
        assert!(matches!(error.problem(), ImageError::Parameter { .. }), "{error}");
        assert!(error.to_string().contains("standard deviation"), "{error}");
    }
}

/// Σ w v / Σ w over the box of 4σ around a voxel, in three dimensions at once.
fn by_definition(image: &IntensityVolume, sigma_mm: f64, at: [usize; 3]) -> f64 {
    let grid = image.grid();
    let (mut sum, mut total) = (0.0, 0.0);
    let [nx, ny, nz] = grid.dims;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let steps = [x.abs_diff(at[0]), y.abs_diff(at[1]), z.abs_diff(at[2])];
                let mm = steps.map(|step| step as f64 * grid.spacing_mm);
                if mm.iter().any(|mm| *mm > 4.0 * sigma_mm) {
                    continue;
                }
                let squared: f64 = mm.iter().map(|mm| mm * mm).sum();
                let weight = (-squared / (2.0 * sigma_mm * sigma_mm)).exp();
                sum += weight * f64::from(image.get(x, y, z).unwrap());
                total += weight;
            }
        }
    }
    sum / total
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn three_passes_are_the_definition(
        dims in [1usize..7, 1usize..7, 1usize..7],
        sigma in 0.3f64..4.0,
        spacing in 0.5f64..2.0,
        seed in prop::collection::vec(-100.0f32..100.0, 216),
    ) {
        let count = dims.iter().product();
        let image = image(dims, spacing, seed[..count].to_vec());
        let blurred = gaussian_blur(&image, sigma).unwrap();
        for index in 0..count {
            let at = [index % dims[0], index / dims[0] % dims[1], index / (dims[0] * dims[1])];
            let want = by_definition(&image, sigma, at);
            let found = f64::from(blurred.values()[index]);
            // Values up to 100 rounded to f32 after each pass, averaged by the next ones.
            prop_assert!((found - want).abs() < 3.0 * 100.0 * 6e-8, "{found} {want}");
        }
    }

    #[test]
    fn constants_stay_bit_by_bit(
        dims in [1usize..7, 1usize..7, 1usize..7],
        sigma in 0.0f64..9.0,
        value in -2000.0f32..2000.0,
    ) {
        let image = image(dims, 1.5, vec![value; dims.iter().product()]);
        prop_assert_eq!(gaussian_blur(&image, sigma).unwrap(), image);
    }
}
