//! Orders the slices of a series along their normal and checks that they are a regular grid.

use nalgebra::Vector3;

use super::error::DicomError;
use super::image::{Image, Plane};
use super::tag::{COLUMNS, ORIENTATION, PIXEL_SPACING, ROWS, Tag};
use crate::image::ImageError;
use crate::image::placement::VoxelAffine;

/// How far directions of one series may differ, entry by entry: printed digits.
const SAME_DIRECTION: f64 = 1e-4;

/// How far spacings within a slice may differ, as a part of them.
const SAME_SPACING: f64 = 1e-4;

/// Distances from the regular grid that are accepted: this part of the spacing …
const EVEN_PART: f64 = 0.01;

/// … and this for printed digits, mm.
const EVEN_MM: f64 = 0.01;

/// Largest tangent of the angle between the line of the slices and their normal; beyond it the
/// grid is sheared.
const MAX_TILT: f64 = 1e-3;

/// A gap this much larger than the median one has room for another slice.
const GAP: f64 = 1.5;

/// One slice: a plane of an image.
#[derive(Clone, Copy)]
pub(super) struct Slice<'a> {
    pub image: &'a Image,
    pub plane: &'a Plane,
    /// Position along the normal, mm.
    at: f64,
}

impl Slice<'_> {
    /// File and frame.
    fn name(&self) -> String {
        let path = self.image.path.display();
        match self.image.planes.len() {
            1 => path.to_string(),
            _ => format!("{path}, frame {}", self.plane.frame + 1),
        }
    }
}

/// All slices in their order along the normal, and the grid that they make.
///
/// The normal is along_row × along_column of the first image; neither names nor instance numbers
/// count. There is at least one image; `series` is for messages.
pub(super) fn stack<'a>(
    images: &'a [Image],
    series: &str,
) -> Result<(Vec<Slice<'a>>, VoxelAffine), ImageError> {
    let first = &images[0];
    for image in images {
        check_alike(image, first).map_err(ImageError::in_file(&image.path))?;
    }
    let reference = &first.planes[0];
    let normal = reference.along_row.cross(&reference.along_column).normalize();
    let mut slices = Vec::new();
    for image in images {
        for plane in &image.planes {
            slices.push(Slice { image, plane, at: plane.position.dot(&normal) });
        }
    }
    slices.sort_by(|a, b| a.at.total_cmp(&b.at));
    if slices.len() < 2 {
        let few = DicomError::TooFewSlices { series: series.into(), slices: slices.len() };
        return Err(ImageError::in_file(&first.path)(few));
    }
    check_gaps(&slices)?;
    let step = step(&slices, normal)?;
    check_tilt(step, normal).map_err(ImageError::in_file(&slices[0].image.path))?;
    let to_ras = |v: Vector3<f64>| Vector3::new(-v.x, -v.y, v.z);
    let [between_rows, between_columns] = reference.spacing;
    let columns = [
        to_ras(reference.along_row * between_columns),
        to_ras(reference.along_column * between_rows),
        to_ras(step),
    ];
    let first_centre = to_ras(slices[0].plane.position);
    Ok((slices, VoxelAffine { form: "ImageOrientationPatient", columns, first_centre }))
}

/// Refuses an image whose size, direction or spacing is not that of the first.
fn check_alike(image: &Image, first: &Image) -> Result<(), DicomError> {
    let differs = |tag: Tag, value: String, other_value: String| {
        let (tag, other) = (tag.to_string(), first.path.clone());
        Err(DicomError::Differs { tag, value, other, other_value })
    };
    let (a, b) = (&image.format, &first.format);
    for (tag, a, b) in [(ROWS, a.rows, b.rows), (COLUMNS, a.columns, b.columns)] {
        if a != b {
            return differs(tag, a.to_string(), b.to_string());
        }
    }
    let reference = &first.planes[0];
    for plane in &image.planes {
        let turned = (plane.along_row - reference.along_row)
            .amax()
            .max((plane.along_column - reference.along_column).amax());
        if !(turned <= SAME_DIRECTION) {
            return differs(ORIENTATION, directions(plane), directions(reference));
        }
        let scaled = |i: usize| (plane.spacing[i] / reference.spacing[i] - 1.0).abs();
        if !(scaled(0).max(scaled(1)) <= SAME_SPACING) {
            let shown = |plane: &Plane| format!("{}\\{}", plane.spacing[0], plane.spacing[1]);
            return differs(PIXEL_SPACING, shown(plane), shown(reference));
        }
    }
    Ok(())
}

fn directions(plane: &Plane) -> String {
    let numbers = plane.along_row.iter().chain(&plane.along_column);
    numbers.map(|number| format!("{number:.5}")).collect::<Vec<_>>().join("\\")
}

/// The step from each slice to the next, if they are evenly spaced on a line.
fn step(slices: &[Slice], normal: Vector3<f64>) -> Result<Vector3<f64>, DicomError> {
    let last = slices.len() - 1;
    let start = slices[0].plane.position;
    let step = (slices[last].plane.position - start) / last as f64;
    let spacing_mm = step.dot(&normal);
    let limit_mm = EVEN_MM + EVEN_PART * spacing_mm;
    for (index, slice) in slices.iter().enumerate() {
        let off = slice.plane.position - (start + step * index as f64);
        let along = off.dot(&normal);
        if !(along.abs() <= limit_mm) {
            let (slice, off_mm) = (slice.name(), along.abs());
            return Err(DicomError::UnevenSlices { slice, off_mm, spacing_mm, limit_mm });
        }
        let off_mm = (off - normal * along).norm();
        if !(off_mm <= limit_mm) {
            return Err(DicomError::ShiftedSlice { slice: slice.name(), off_mm, limit_mm });
        }
    }
    Ok(step)
}

fn check_tilt(step: Vector3<f64>, normal: Vector3<f64>) -> Result<(), DicomError> {
    let spacing_mm = step.dot(&normal);
    let tilt = (step - normal * spacing_mm).norm() / spacing_mm;
    if !(tilt <= MAX_TILT) {
        let [degrees, limit_degrees] = [tilt, MAX_TILT].map(|tilt| tilt.atan().to_degrees());
        return Err(DicomError::GantryTilt { degrees, limit_degrees });
    }
    Ok(())
}

/// Refuses two slices at one place, and gaps with room for more.
fn check_gaps(slices: &[Slice]) -> Result<(), DicomError> {
    let gaps = || slices.windows(2).map(|pair| (pair[1].at - pair[0].at, &pair[0], &pair[1]));
    for (apart_mm, first, second) in gaps() {
        if !(apart_mm > EVEN_MM) {
            let (first, second, limit_mm) = (first.name(), second.name(), EVEN_MM);
            return Err(DicomError::SamePosition { first, second, apart_mm, limit_mm });
        }
    }
    let mut sorted: Vec<f64> = gaps().map(|(gap_mm, ..)| gap_mm).collect();
    sorted.sort_by(f64::total_cmp);
    // The lower median: of two gaps the smaller one is the spacing.
    let spacing_mm = sorted[(sorted.len() - 1) / 2];
    for (gap_mm, first, second) in gaps() {
        if gap_mm > GAP * spacing_mm {
            let missing = (gap_mm / spacing_mm).round() as u64 - 1;
            let (first, second) = (first.name(), second.name());
            return Err(DicomError::MissingSlices { first, second, missing, gap_mm, spacing_mm });
        }
    }
    Ok(())
}
