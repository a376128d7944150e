//! Labels from intensities: one half-open range of values per label.

use crate::image::ImageError;
use crate::image::volume::{IntensityVolume, LabelVolume};

/// The values that get one label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange {
    /// The label, other than 0.
    pub label: i64,
    /// The smallest value, in the image's unit; may be −∞.
    pub low: f64,
    /// The end, which does not belong to it; may be +∞.
    pub high: f64,
}

impl ValueRange {
    /// True where low ≤ value < high.
    pub fn contains(&self, value: f32) -> bool {
        let value = f64::from(value);
        self.low <= value && value < self.high
    }
}

/// The label volume in which a voxel of value v has the label of the range with low ≤ v < high,
/// and is void (0) where there is none. Labels that no voxel gets are not in its table.
///
/// Cost: O(voxels · ranges), less where neighbours are alike.
///
/// # Errors
/// [`ImageError::ValueRange`] for a range with label 0 or without low < high (a NaN too);
/// [`ImageError::RangesMeet`] for two that overlap or have the same label.
pub fn classify(image: &IntensityVolume, ranges: &[ValueRange]) -> Result<LabelVolume, ImageError> {
    check(ranges)?;
    let label_of = |value: f32| {
        ranges.iter().find(|range| range.contains(value)).map_or(0, |range| range.label)
    };
    let labels = image.values().iter().map(|&value| label_of(value));
    LabelVolume::from_original(image.grid().clone(), labels)
}

fn check(ranges: &[ValueRange]) -> Result<(), ImageError> {
    for (index, &ValueRange { label, low, high }) in ranges.iter().enumerate() {
        let refuse = |want| ImageError::ValueRange { index, label, low, high, want };
        // Negated, so that a NaN fails too.
        if !(low < high) {
            return Err(refuse("a lower end below the upper end"));
        }
        if label == 0 {
            return Err(refuse("a label other than 0, which is void"));
        }
        for (first, other) in ranges[..index].iter().enumerate() {
            let what = if other.label == label {
                "a label"
            } else if low < other.high && other.low < high {
                "values"
            } else {
                continue;
            };
            return Err(ImageError::RangesMeet { first, second: index, what });
        }
    }
    Ok(())
}
