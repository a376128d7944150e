//! One file's image: how its pixels are stored and where its frames lie.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::cursor::Element;
use super::data_set::DataSet;
use super::error::DicomError;
use super::file::{Codec, DicomFile};
use super::format::Format;
use super::frames::check_compressed;
use super::tag::*;
use crate::image::ImageError;
use crate::image::voxels::check_count;

/// Segmentation objects: their frames are bits, several for one place.
const SEGMENTATION: &str = "1.2.840.10008.5.1.4.1.1.66.4";

/// Positions and spacings beyond this are no scanner's, mm; keeps squares finite.
const MAX_MM: f64 = 1e6;

/// How far a direction may be from length 1: headers hold 6 digits or so.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Where one frame lies, in the axes of the patient: left, posterior, superior.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    /// Counted from 0.
    pub frame: usize,
    /// Centre of the first pixel, mm.
    pub position: Vector3<f64>,
    /// Unit direction of rising column numbers.
    pub along_row: Vector3<f64>,
    /// Unit direction of rising row numbers.
    pub along_column: Vector3<f64>,
    /// Between rows, between columns, mm.
    pub spacing: [f64; 2],
    /// Slope and intercept.
    pub scale: [f64; 2],
}

/// What a file's header says about its image.
#[derive(Debug)]
pub(super) struct Image {
    pub path: PathBuf,
    pub format: Format,
    /// One per frame, at least one.
    pub planes: Vec<Plane>,
}

impl Image {
    /// Reads and checks the header, and that the pixels can be there.
    pub fn of(file: &DicomFile, data: &DataSet) -> Result<Self, ImageError> {
        let check = || -> Result<Self, ImageError> {
            check_kind(data)?;
            file.check_codec()?;
            let pixels = data.require(PIXELS)?;
            let format = format(data)?;
            let count = frame_count(data)?;
            check_count([format.columns.into(), format.rows.into(), count as u64])?;
            check_pixels(file, data, &format, count, pixels)?;
            Ok(Self { path: file.path.clone(), format, planes: planes(data, count)? })
        };
        check().map_err(ImageError::in_file(&file.path))
    }
}

/// Refuses what is no image of numbers.
fn check_kind(data: &DataSet) -> Result<(), DicomError> {
    if data.text(SOP_CLASS) == SEGMENTATION {
        let want = "an image; export the segmentation as a label map in NIfTI or NRRD";
        return Err(SOP_CLASS.refuse("a segmentation object", want));
    }
    for tag in [FLOAT_PIXELS, DOUBLE_PIXELS] {
        if data.get(tag).is_some() {
            return Err(tag.refuse("present", "integers in PixelData (7FE0,0010)"));
        }
    }
    let photometric = data.text(PHOTOMETRIC);
    let samples = data.required_u16(SAMPLES)?;
    if samples != 1 {
        let value = format!("{samples} ({photometric})");
        return Err(SAMPLES.refuse(value, "1: colour is no measured quantity"));
    }
    if !["MONOCHROME1", "MONOCHROME2"].contains(&photometric.as_str()) {
        let want = "MONOCHROME1 or MONOCHROME2";
        return Err(PHOTOMETRIC.refuse(format!("\"{photometric}\""), want));
    }
    if data.get(MODALITY_LUT).is_some() {
        return Err(MODALITY_LUT.refuse("a table of values", "slope and intercept"));
    }
    Ok(())
}

fn format(data: &DataSet) -> Result<Format, DicomError> {
    let size = |tag| match data.required_u16(tag)? {
        0 => Err(tag.refuse(0, "1 to 65535")),
        size => Ok(size),
    };
    let allocated = data.required_u16(BITS_ALLOCATED)?;
    if ![8, 16, 32].contains(&allocated) {
        return Err(BITS_ALLOCATED.refuse(allocated, "8, 16 or 32"));
    }
    let stored = data.required_u16(BITS_STORED)?;
    if !(1..=allocated).contains(&stored) {
        return Err(BITS_STORED.refuse(stored, "1 to BitsAllocated (0028,0100)"));
    }
    let high = data.u16(HIGH_BIT)?.unwrap_or(stored - 1);
    if !(stored - 1..allocated).contains(&high) {
        let want = "BitsStored (0028,0101) − 1 to BitsAllocated (0028,0100) − 1";
        return Err(HIGH_BIT.refuse(high, want));
    }
    let signed = match data.required_u16(PIXEL_REPRESENTATION)? {
        0 => false,
        1 => true,
        other => return Err(PIXEL_REPRESENTATION.refuse(other, "0 or 1")),
    };
    Ok(Format {
        columns: size(COLUMNS)?,
        rows: size(ROWS)?,
        allocated: allocated.into(),
        stored: stored.into(),
        shift: u32::from(high + 1 - stored),
        signed,
    })
}

fn frame_count(data: &DataSet) -> Result<usize, DicomError> {
    const WANT: &str = "a whole number ≥ 1";
    let Some([count]) = data.numbers(FRAMES, WANT)? else { return Ok(1) };
    if !(count >= 1.0 && count <= f64::from(u32::MAX) && count.fract() == 0.0) {
        return Err(FRAMES.refuse(count, WANT));
    }
    Ok(count as usize)
}

/// Whether the pixel data hold as many frames: before anything is allocated for them.
fn check_pixels(
    file: &DicomFile,
    data: &DataSet,
    format: &Format,
    count: usize,
    pixels: &Element,
) -> Result<(), DicomError> {
    if file.codec != Codec::Raw {
        return check_compressed(data, format, count, pixels);
    }
    if pixels.delimited {
        let want = "bytes of a stated length, as the transfer syntax says";
        return Err(PIXELS.refuse("in fragments", want));
    }
    if format.allocated == 32 && pixels.encoding.big_endian {
        let want = "8 or 16 in big endian, which leaves the order of a 32-bit pixel's words open";
        return Err(BITS_ALLOCATED.refuse(32, want));
    }
    // Below 2³³: the voxels were counted.
    let want = (format.frame_bytes() * count) as u64;
    let found = pixels.bytes.len() as u64;
    // Where bytes stand in words, the last word must be whole.
    let want = if pixels.encoding.big_endian { want.next_multiple_of(2) } else { want };
    if found > want + 1 && found < want + format.frame_bytes() as u64 {
        let path = file.path.display();
        tracing::warn!("{path}: {found} bytes of pixels where {want} belong; the rest left unread");
    } else if found < want || found > want + 1 {
        return Err(DicomError::PixelLength { found, want });
    }
    Ok(())
}

/// Where all frames lie: by the image itself, or by its functional groups.
fn planes(data: &DataSet, count: usize) -> Result<Vec<Plane>, DicomError> {
    let shared = data.items(SHARED_GROUPS)?;
    let frames = data.items(FRAME_GROUPS)?;
    if frames.is_empty() && count > 1 {
        let want = "1, or positions in PerFrameFunctionalGroupsSequence (5200,9230)";
        return Err(FRAMES.refuse(count, want));
    }
    if !frames.is_empty() && frames.len() != count {
        let value = format!("of {} items", frames.len());
        return Err(FRAME_GROUPS.refuse(value, "one per frame, NumberOfFrames (0028,0008)"));
    }
    (0..count).map(|frame| plane(data, frames.get(frame), shared.first(), frame)).collect()
}

fn plane<'a>(
    data: &DataSet<'a>,
    own: Option<&DataSet<'a>>,
    shared: Option<&DataSet<'a>>,
    frame: usize,
) -> Result<Plane, DicomError> {
    const WANT: &str = "three numbers, mm, up to 1e6";
    // The frame's own group, the one of all frames, or the image itself.
    let group = |sequence| -> Result<DataSet<'a>, DicomError> {
        for groups in [own, shared].into_iter().flatten() {
            if let Some(group) = groups.items(sequence)?.into_iter().next() {
                return Ok(group);
            }
        }
        Ok(data.clone())
    };
    let position = Vector3::from(group(PLANE_POSITION)?.required(POSITION, WANT)?);
    if position.amax() > MAX_MM {
        return Err(POSITION.refuse(position.amax(), WANT));
    }
    let [along_row, along_column] = orientation(&group(PLANE_ORIENTATION)?)?;
    let spacing = spacing(&group(PIXEL_MEASURES)?)?;
    let scale = scale(&group(VALUE_TRANSFORMATION)?)?;
    Ok(Plane { frame, position, along_row, along_column, spacing, scale })
}

fn spacing(group: &DataSet) -> Result<[f64; 2], DicomError> {
    const WANT: &str = "two numbers > 0, mm, up to 1e6";
    let spacing: [f64; 2] = group.required(PIXEL_SPACING, WANT)?;
    match spacing.iter().find(|s| !(**s > 0.0 && **s <= MAX_MM)) {
        Some(bad) => Err(PIXEL_SPACING.refuse(bad, WANT)),
        None => Ok(spacing),
    }
}

fn orientation(group: &DataSet) -> Result<[Vector3<f64>; 2], DicomError> {
    const WANT: &str = "two directions of length 1 at right angles to 0.001";
    let [a, b, c, d, e, f] = group.required(ORIENTATION, WANT)?;
    let axes = [Vector3::new(a, b, c), Vector3::new(d, e, f)];
    let unit = axes.iter().all(|axis| (axis.norm() - 1.0).abs() <= UNIT_TOLERANCE);
    if !unit || axes[0].dot(&axes[1]).abs() > UNIT_TOLERANCE {
        return Err(ORIENTATION.refuse(format!("{a}\\{b}\\{c}\\{d}\\{e}\\{f}"), WANT));
    }
    Ok(axes.map(|axis| axis.normalize()))
}

/// Slope and intercept of the rescaling, 1 and 0 where there is none.
fn scale(group: &DataSet) -> Result<[f64; 2], DicomError> {
    let number = |tag, missing| -> Result<f64, DicomError> {
        Ok(group.numbers(tag, "one finite number")?.map_or(missing, |[value]| value))
    };
    let slope = number(SLOPE, 1.0)?;
    if slope == 0.0 {
        return Err(SLOPE.refuse(slope, "other than 0"));
    }
    Ok([slope, number(INTERCEPT, 0.0)?])
}
