//! Labels from ranges of intensities.

use yawara_mesh::ImageError;
use yawara_mesh::image::{ValueRange, classify};
use yawara_mesh::volume::{Grid, IntensityVolume};

fn image(values: &[f32]) -> IntensityVolume {
    IntensityVolume::new(Grid::centred([values.len(), 1, 1], 2.0), values.to_vec()).unwrap()
}

fn range(label: i64, low: f64, high: f64) -> ValueRange {
    ValueRange { label, low, high }
}

#[test]
fn a_range_has_its_lower_end_and_not_its_upper_one() {
    let image = image(&[-151.0, -150.0, -30.5, -30.0, 149.0, 150.0, 3e30, -3e30]);
    let ranges = [
        range(20, -30.0, 150.0),
        range(-7, -150.0, -30.0),
        range(5, 150.0, f64::INFINITY),
        range(99, -1e3, -900.0),
    ];
    let volume = classify(&image, &ranges).unwrap();
    let labels: Vec<i64> =
        volume.labels().iter().map(|&id| volume.values()[usize::from(id)]).collect();
    assert_eq!(labels, [0, -7, -7, 20, 20, 5, 5, 0]);
    assert_eq!(volume.values(), [0, -7, 5, 20], "99 has no voxel");
    assert_eq!(volume.grid(), image.grid());
    let all = classify(&image, &[range(1, f64::NEG_INFINITY, f64::INFINITY)]).unwrap();
    assert_eq!(all.counts(), [0, 8]);
    assert_eq!(classify(&image, &[]).unwrap().counts(), [8]);
}

#[test]
fn ranges_that_say_nothing_or_two_things_are_refused() {
    let nan = f64::NAN;
    for bad in [
        range(1, 5.0, 5.0),
        range(1, 6.0, 5.0),
        range(1, nan, 5.0),
        range(1, 5.0, nan),
        range(0, 1.0, 2.0),
    ] {
        let error = classify(&image(&[0.0]), &[range(2, 7.0, 8.0), bad]).unwrap_err();
        assert!(matches!(error.problem(), ImageError::ValueRange { index: 1, .. }), "{error}");
    }
    let middle = range(1, 0.0, 10.0);
    for meeting in [
        range(2, 9.0, 20.0),
        range(2, -5.0, 0.5),
        range(2, 3.0, 4.0),
        range(2, -1.0, 11.0),
        range(2, 0.0, 10.0),
        range(1, 10.0, 20.0),
    ] {
        for pair in [[middle, meeting], [meeting, middle]] {
            let error = classify(&image(&[0.0]), &pair).unwrap_err();
            assert!(
                matches!(error.problem(), ImageError::RangesMeet { first: 0, second: 1, .. }),
                "{error}"
            );
        }
    }
    for beside in [range(2, 10.0, 20.0), range(2, -5.0, 0.0)] {
        classify(&image(&[0.0]), &[middle, beside]).unwrap();
    }
}
