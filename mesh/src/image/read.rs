//! Reads an image file of any format that was built in, recognised by its content.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::image::ImageError;
use crate::image::raw::RawVolume;
use crate::image::resample::Resampling;
use crate::image::volume::{IntensityVolume, LabelVolume};

/// How many bytes at the start of a file are looked at: the DICOM magic ends at 132.
const START_BYTES: u64 = 512;

/// What a reader did besides reading.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ReadReport {
    /// The format's name, e.g. `NIfTI`.
    pub format: &'static str,
    /// How the voxels were made cubes, or `None` if they were.
    pub resampling: Option<Resampling>,
    /// RAS+ axis i runs along the file's axis `axes[i].0`, backwards if `axes[i].1`.
    pub axes: [(usize, bool); 3],
    /// The names that the file gives labels, as 3D Slicer does in a `.seg.nrrd`.
    pub label_names: BTreeMap<i64, String>,
}

/// Reads a label map: one integer per voxel, of any integer or float type, NIfTI, NRRD,
/// MetaImage, VTK image data, or a DICOM series (its directory, or one file of it).
///
/// As [`read_labels_with`] without a spacing; resampling is told by a warning.
///
/// # Errors
/// As [`read_labels_with`].
pub fn read_labels(path: &Path) -> Result<LabelVolume, ImageError> {
    let (volume, report) = read_labels_with(path, None)?;
    warn(path, &report);
    Ok(volume)
}

/// Reads an intensity image, e.g. a CT in Hounsfield units: one finite f32 per voxel, scaled.
///
/// As [`read_intensities_with`] without a spacing; resampling is told by a warning.
///
/// # Errors
/// As [`read_intensities_with`].
pub fn read_intensities(path: &Path) -> Result<IntensityVolume, ImageError> {
    let (volume, report) = read_intensities_with(path, None)?;
    warn(path, &report);
    Ok(volume)
}

/// Reads a label map and says what was done to it.
///
/// The format is known by the content, else by the extension. Axes are permuted and flipped to
/// RAS+; a remaining rotation stays in the grid. Spacings within 1 % of one another count as
/// their geometric mean; others are resampled by nearest neighbour to the smallest of the
/// three. With `spacing_mm`, whatever is stored is resampled to that.
///
/// Cost: O(voxels); at most three copies of the stored bytes and 2 bytes a voxel in memory.
///
/// # Errors
/// [`ImageError`] that names the file and the place: no readable file, no image of a format that
/// was built in, a header that contradicts itself or the file's length, more than one volume,
/// more than 2³¹ voxels, no real voxel type, a singular or sheared affine, spacings so unequal
/// that resampling makes over 256 voxels of one, a voxel that is no integer, more than 65 535
/// labels.
pub fn read_labels_with(
    path: &Path,
    spacing_mm: Option<f64>,
) -> Result<(LabelVolume, ReadReport), ImageError> {
    let (format, raw) = read_raw(path)?;
    let (axes, label_names) = (raw.axes(), raw.label_names().clone());
    let (volume, resampling) = raw.labels(spacing_mm)?;
    Ok((volume, ReadReport { format, resampling, axes, label_names }))
}

/// Reads an intensity image and says what was done to it.
///
/// As [`read_labels_with`], but resampled trilinearly.
///
/// # Errors
/// As [`read_labels_with`], but for the labels; a voxel that is NaN, infinite or beyond f32.
pub fn read_intensities_with(
    path: &Path,
    spacing_mm: Option<f64>,
) -> Result<(IntensityVolume, ReadReport), ImageError> {
    let (format, raw) = read_raw(path)?;
    let (axes, label_names) = (raw.axes(), raw.label_names().clone());
    let (volume, resampling) = raw.intensities(spacing_mm)?;
    Ok((volume, ReadReport { format, resampling, axes, label_names }))
}

fn warn(path: &Path, report: &ReadReport) {
    if let Some(resampling) = &report.resampling {
        tracing::warn!("{}: {resampling}", path.display());
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Nifti,
    Nrrd,
    MetaImage,
    Vti,
    Dicom,
}

impl Format {
    /// Name and cargo feature.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Nifti => ("NIfTI", "nifti"),
            Self::Nrrd => ("NRRD", "nrrd"),
            Self::MetaImage => ("MetaImage", "metaimage"),
            Self::Vti => ("VTK", "vtu"),
            Self::Dicom => ("DICOM", "dicom"),
        }
    }

    fn of_content(start: &[u8]) -> Option<Self> {
        let starts = |magic: &[u8]| start.starts_with(magic);
        if starts(b"NRRD") {
            return Some(Self::Nrrd);
        }
        // gzip, and lengths of a header, 348 and 540, in either byte order.
        let nifti = [
            &[0x1f, 0x8b][..],
            &[0x5c, 1, 0, 0],
            &[0, 0, 1, 0x5c],
            &[0x1c, 2, 0, 0],
            &[0, 0, 2, 0x1c],
        ];
        if nifti.into_iter().any(starts) {
            return Some(Self::Nifti);
        }
        if start.get(128..132) == Some(b"DICM") {
            return Some(Self::Dicom);
        }
        // Of any kind: the reader says which ones it does not take.
        let xml = start.trim_ascii_start();
        if xml.starts_with(b"<") && xml.windows(8).any(|word| word == b"<VTKFile") {
            return Some(Self::Vti);
        }
        let first_key = start.split(|&byte| byte == b'=').next().unwrap_or_default().trim_ascii();
        let keys: [&[u8]; 2] = [b"ObjectType", b"NDims"];
        keys.iter().any(|key| first_key.eq_ignore_ascii_case(key)).then_some(Self::MetaImage)
    }

    fn of_name(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "nii" | "gz" | "hdr" => Some(Self::Nifti),
            "nrrd" | "nhdr" => Some(Self::Nrrd),
            "mha" | "mhd" => Some(Self::MetaImage),
            "vti" => Some(Self::Vti),
            "dcm" => Some(Self::Dicom),
            _ => None,
        }
    }
}

fn read_raw(path: &Path) -> Result<(&'static str, RawVolume), ImageError> {
    let format = format_of(path).map_err(ImageError::in_file(path))?;
    let (name, feature) = format.names();
    let raw = match format {
        #[cfg(feature = "nifti")]
        Format::Nifti => super::nifti::read_nifti(path),
        #[cfg(feature = "nrrd")]
        Format::Nrrd => super::nrrd::read_nrrd(path),
        #[cfg(feature = "metaimage")]
        Format::MetaImage => super::metaimage::read_metaimage(path),
        #[cfg(feature = "vtu")]
        Format::Vti => super::vti::read_vti(path),
        #[cfg(feature = "dicom")]
        Format::Dicom => super::dicom::read_dicom(path),
        // Formats whose reader this build leaves out.
        #[allow(unreachable_patterns)] // Where all are built in.
        _ => Err(ImageError::in_file(path)(ImageError::FormatNotBuilt { format: name, feature })),
    };
    Ok((name, raw?))
}

fn format_of(path: &Path) -> Result<Format, ImageError> {
    let metadata = std::fs::metadata(path)?;
    // The only format that keeps an image in a directory.
    if cfg!(feature = "dicom") && metadata.is_dir() {
        return Ok(Format::Dicom);
    }
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a directory" } else { "no regular file" };
        return Err(ImageError::NotAFile(found));
    }
    let mut start = Vec::new();
    File::open(path)?.take(START_BYTES).read_to_end(&mut start)?;
    if start.is_empty() {
        return Err(ImageError::EmptyFile);
    }
    Format::of_content(&start).or_else(|| Format::of_name(path)).ok_or_else(|| {
        let start = &start[..start.len().min(16)];
        ImageError::UnknownFormat(start.escape_ascii().to_string())
    })
}
