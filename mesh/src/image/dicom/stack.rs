//! Orders the slices of a series along their normal and checks that they are a regular grid.

use std::path::Path;

use nalgebra::Vector3;

use super::error::DicomError;
use super::image::{Image, Plane};
use super::tag::{COLUMNS, ORIENTATION, PIXEL_SPACING, ROWS, Tag};
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

/// One file of the series and what its header says.
pub(super) struct Member<'a> {
    pub path: &'a Path,
    pub image: &'a Image,
}

/// One slice: the file by its place in the list of members, and its plane.
#[derive(Clone, Copy)]
pub(super) struct Slice<'a> {
    pub member: usize,
    pub plane: &'a Plane,
    /// Position along the normal, mm.
    at: f64,
}

/// All slices in their order along the normal, and the grid that they make.
///
/// The normal is along_row × along_column of the first member; neither names nor instance
/// numbers count. There is at least one member; `series` is for messages.
pub(super) fn stack<'a>(
    members: &[Member<'a>],
    series: &str,
) -> Result<(Vec<Slice<'a>>, VoxelAffine), DicomError> {
    check_alike(members)?;
    let first = &members[0];
    let reference = &first.image.planes[0];
    let normal = reference.along_row.cross(&reference.along_column).normalize();
    let mut slices = Vec::new();
    for (member, Member { image, .. }) in members.iter().enumerate() {
        for plane in &image.planes {
            slices.push(Slice { member, plane, at: plane.position.dot(&normal) });
        }
    }
    slices.sort_by(|a, b| a.at.total_cmp(&b.at));
    if slices.len() < 2 {
        let (path, series) = (first.path.into(), series.into());
        return Err(DicomError::TooFewSlices { path, series, slices: slices.len() });
    }
    let step = Line { members, slices: &slices, normal }.step()?;
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

/// Refuses images of different size, direction or spacing.
fn check_alike(members: &[Member]) -> Result<(), DicomError> {
    let first = &members[0];
    let reference = &first.image.planes[0];
    for Member { path, image } in members {
        let differs = |tag: Tag, value: String, other_value: String| {
            let (path, tag, other) = (path.to_path_buf(), tag.to_string(), first.path.into());
            Err(DicomError::Differs { path, tag, value, other, other_value })
        };
        let (a, b) = (&image.format, &first.image.format);
        if a.rows != b.rows {
            return differs(ROWS, a.rows.to_string(), b.rows.to_string());
        }
        if a.columns != b.columns {
            return differs(COLUMNS, a.columns.to_string(), b.columns.to_string());
        }
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
    }
    Ok(())
}

fn directions(plane: &Plane) -> String {
    let numbers = plane.along_row.iter().chain(&plane.along_column);
    numbers.map(|number| format!("{number:.5}")).collect::<Vec<_>>().join("\\")
}

/// The slices in order, at least two.
struct Line<'a> {
    members: &'a [Member<'a>],
    slices: &'a [Slice<'a>],
    normal: Vector3<f64>,
}

impl Line<'_> {
    fn path(&self, index: usize) -> &Path {
        self.members[self.slices[index].member].path
    }

    fn name(&self, index: usize) -> String {
        let path = self.path(index).display();
        match self.members[self.slices[index].member].image.planes.len() {
            1 => path.to_string(),
            _ => format!("{path}, frame {}", self.slices[index].plane.frame + 1),
        }
    }

    /// The step from each slice to the next, if they are evenly spaced along their normal.
    fn step(&self) -> Result<Vector3<f64>, DicomError> {
        self.check_gaps()?;
        let last = self.slices.len() - 1;
        let start = self.slices[0].plane.position;
        let step = (self.slices[last].plane.position - start) / last as f64;
        let spacing_mm = step.dot(&self.normal);
        let limit_mm = EVEN_MM + EVEN_PART * spacing_mm;
        for (index, slice) in self.slices.iter().enumerate() {
            let off = slice.plane.position - (start + step * index as f64);
            let along = off.dot(&self.normal);
            let (slice, off_mm) = (|| self.name(index), along.abs());
            if !(off_mm <= limit_mm) {
                let slice = slice();
                return Err(DicomError::UnevenSlices { slice, off_mm, spacing_mm, limit_mm });
            }
            let off_mm = (off - self.normal * along).norm();
            if !(off_mm <= limit_mm) {
                return Err(DicomError::ShiftedSlice { slice: slice(), off_mm, limit_mm });
            }
        }
        let tilt = (step - self.normal * spacing_mm).norm() / spacing_mm;
        if !(tilt <= MAX_TILT) {
            return Err(DicomError::GantryTilt {
                path: self.path(0).into(),
                degrees: tilt.atan().to_degrees(),
                limit_degrees: MAX_TILT.atan().to_degrees(),
            });
        }
        Ok(step)
    }

    /// Refuses two slices at one place, and gaps with room for more.
    fn check_gaps(&self) -> Result<(), DicomError> {
        let gaps: Vec<f64> = self.slices.windows(2).map(|pair| pair[1].at - pair[0].at).collect();
        for (index, &apart_mm) in gaps.iter().enumerate() {
            if !(apart_mm > EVEN_MM) {
                let (first, second) = (self.name(index), self.name(index + 1));
                let limit_mm = EVEN_MM;
                return Err(DicomError::SamePosition { first, second, apart_mm, limit_mm });
            }
        }
        let mut sorted = gaps.clone();
        sorted.sort_by(f64::total_cmp);
        // The lower median: of two gaps the smaller one is the spacing.
        let spacing_mm = sorted[(sorted.len() - 1) / 2];
        for (index, &gap_mm) in gaps.iter().enumerate() {
            if gap_mm > GAP * spacing_mm {
                let missing = (gap_mm / spacing_mm).round() as u64 - 1;
                let (first, second) = (self.name(index), self.name(index + 1));
                return Err(DicomError::MissingSlices {
                    first,
                    second,
                    missing,
                    gap_mm,
                    spacing_mm,
                });
            }
        }
        Ok(())
    }
}
